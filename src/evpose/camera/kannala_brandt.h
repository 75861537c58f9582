// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>

#include "evpose/camera/camera.h"

namespace evpose {

/// Kannala-Brandt ("equidistant", OpenCV's fisheye). With a = angle from the optical axis:
///   m' = a (1 + k1 a^2 + k2 a^4 + k3 a^6 + k4 a^8) * (x, y) / |(x, y)|.
/// The valid domain ends where the radius stops growing with the angle, at the latest at pi; points behind
/// the plane z = 0 project as long as they lie inside it.
class KannalaBrandt final : public Camera {
 public:
  /// `intrinsics` as checked by make_camera; model "equidistant".
  explicit KannalaBrandt(const CameraIntrinsics& intrinsics);

  std::optional<Eigen::Vector2d> project(const Eigen::Vector3d& point_cam,
                                         Matrix23d* jacobian) const override;
  std::optional<Eigen::Vector3d> unproject(const Eigen::Vector2d& pixel) const override;
  double valid_angle() const override { return valid_angle_; }
  ImageSize size() const override { return size_; }
  double focal_px() const override;
  std::string model() const override { return "pinhole-equidistant"; }

 private:
  double radius(double angle) const;
  double radius_slope(double angle) const;

  double fx_, fy_, cx_, cy_;
  std::array<double, 4> k_;
  ImageSize size_;
  double valid_angle_;
};

}  // namespace evpose
