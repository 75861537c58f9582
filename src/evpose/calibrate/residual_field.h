// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/fusion/state.h"
#include "evpose/report/calibration_page.h"

namespace evpose {

/// Where events lie beside their contours, by place in the image. A contour tells the offset along its normal
/// alone; contours of several directions in a cell tell both components.
class ResidualField {
 public:
  explicit ResidualField(ImageSize size);

  /// `T_body_cam`, `camera`: those that the contours were measured with.
  void add(std::span<const ContourOffset> contours, const Camera& camera, const Pose& T_body_cam);

  /// Mean offset of each cell that was seen often enough and by contours of more than one direction.
  std::vector<FieldArrow> arrows() const;
  /// Offsets away from the middle of the image, in rings.
  std::vector<RadiusBin> by_radius() const;
  /// Share of the cells in which contours were seen.
  double coverage() const;

 private:
  struct Cell {
    Eigen::Matrix2d information = Eigen::Matrix2d::Zero();
    Eigen::Vector2d vector = Eigen::Vector2d::Zero();
    int seen = 0;
  };
  struct Ring {
    double weight = 0, offset = 0, square = 0, squared_cosine = 0;
    int seen = 0;
  };

  ImageSize size_;
  int columns_, rows_;
  std::vector<Cell> cells_;
  std::vector<Ring> rings_;
};

/// By how much two calibrations differ over the image, where `from` sees what `to` sees elsewhere; without
/// the turn of the camera that brings both together as well as it can, since that is told from the pose
/// alone.
std::vector<FieldArrow> model_difference(const Camera& from, const Camera& to);
/// Square root of the mean square of their lengths, px.
double rms_px(std::span<const FieldArrow> arrows);

}  // namespace evpose
