// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evpose/camera/camera.h"

namespace evpose {

/// Double sphere (Usenko et al. 2018, "ds" of Kalibr and Basalt). With d = |(x, y, z)|, w = xi d + z and
/// e = |(x, y, w)|:
///   m' = (x, y) / (alpha e + (1 - alpha) w).
/// Radially symmetric. The valid domain ends where the radius stops growing with the angle.
class DoubleSphere final : public Camera {
 public:
  /// `intrinsics` as checked by make_camera; model "ds".
  explicit DoubleSphere(const CameraIntrinsics& intrinsics);

  std::optional<Eigen::Vector2d> project(const Eigen::Vector3d& point_cam,
                                         Matrix23d* jacobian) const override;
  std::optional<Eigen::Vector3d> unproject(const Eigen::Vector2d& pixel) const override;
  double valid_angle() const override { return valid_angle_; }
  ImageSize size() const override { return size_; }
  double focal_px() const override;
  std::string model() const override { return "ds-none"; }

 private:
  double slope(double angle) const;

  double fx_, fy_, cx_, cy_, xi_, alpha_;
  ImageSize size_;
  double valid_angle_;
};

}  // namespace evpose
