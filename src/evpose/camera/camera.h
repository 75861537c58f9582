// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "evpose/core/error.h"

namespace evpose {

struct ImageSize {
  int width = 0, height = 0;  ///< pixels

  bool operator==(const ImageSize&) const = default;
  /// True where a read at (x, y) between pixel centres has all its neighbours, `margin` px from the border.
  bool contains(const Eigen::Vector2d& pixel, double margin = 0) const {
    return pixel.x() >= margin && pixel.y() >= margin && pixel.x() <= width - 1 - margin &&
           pixel.y() <= height - 1 - margin;
  }
};

using Matrix23d = Eigen::Matrix<double, 2, 3>;

/// Central camera. Camera frame: x right, y down, z forward. Pixels: integer coordinates are pixel centres.
class Camera {
 public:
  virtual ~Camera() = default;

  /// Pixel of a point in the camera frame (metres), or nothing outside the model's valid domain: behind the
  /// camera, or beyond valid_angle(). The pixel may lie outside the image. `jacobian`: d pixel / d point
  /// (px/m).
  virtual std::optional<Eigen::Vector2d> project(const Eigen::Vector3d& point_cam,
                                                 Matrix23d* jacobian = nullptr) const = 0;

  /// Unit ray that projects to within 1e-9 px of the pixel, or nothing if none in the valid domain does.
  virtual std::optional<Eigen::Vector3d> unproject(const Eigen::Vector2d& pixel) const = 0;

  /// Largest angle from the optical axis, rad, up to which projection is one-to-one.
  virtual double valid_angle() const = 0;

  virtual ImageSize size() const = 0;
  /// Pixels per radian at the image centre.
  virtual double focal_px() const = 0;
  /// Kalibr's words: "pinhole-radtan", "pinhole-equidistant", "pinhole-none", "ds-none".
  virtual std::string model() const = 0;
};

/// Kalibr's `intrinsics` and `distortion_coeffs` of one camera.
struct CameraIntrinsics {
  double fx = 0, fy = 0, cx = 0, cy = 0;  ///< px
  std::string distortion_model;           ///< "radtan", "equidistant", "ds" (double sphere) or "none"
  std::vector<double> distortion;  ///< radtan: k1 k2 p1 p2 [k3]; equidistant: k1 k2 k3 k4; ds: xi alpha
  ImageSize size;
};

/// Errors: non-positive size or focal length, non-finite numbers, wrong count or unknown model, or a
/// distortion whose one-to-one domain does not reach the image's centre region.
Expected<std::shared_ptr<const Camera>> make_camera(const CameraIntrinsics& intrinsics);

}  // namespace evpose
