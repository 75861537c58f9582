// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evpose/camera/camera.h"

namespace evpose {

/// Pinhole with radial-tangential distortion, in OpenCV's order k1 k2 p1 p2 k3. With m = (x/z, y/z), r = |m|:
///   m' = m (1 + k1 r^2 + k2 r^4 + k3 r^6) + (2 p1 xy + p2 (r^2 + 2x^2), p1 (r^2 + 2y^2) + 2 p2 xy).
/// m' is the gradient of a potential, so its Jacobian is symmetric. The valid domain is the largest circle of
/// m in which that Jacobian is positive definite: the potential is strictly convex there and m -> m' is
/// one-to-one.
class PinholeRadtan final : public Camera {
 public:
  /// `intrinsics` as checked by make_camera; model "radtan" or "none".
  explicit PinholeRadtan(const CameraIntrinsics& intrinsics);

  std::optional<Eigen::Vector2d> project(const Eigen::Vector3d& point_cam,
                                         Matrix23d* jacobian) const override;
  std::optional<Eigen::Vector3d> unproject(const Eigen::Vector2d& pixel) const override;
  double valid_angle() const override { return valid_angle_; }
  ImageSize size() const override { return size_; }
  double focal_px() const override;
  std::string model() const override { return distorted_ ? "pinhole-radtan" : "pinhole-none"; }

 private:
  /// m' of m; `jacobian`: d m' / d m.
  Eigen::Vector2d distort(const Eigen::Vector2d& m, Eigen::Matrix2d* jacobian) const;
  /// Least determinant of the Jacobian over the circle |m| = radius.
  double least_determinant(double radius) const;

  double fx_, fy_, cx_, cy_;
  bool distorted_;
  double k1_ = 0, k2_ = 0, p1_ = 0, p2_ = 0, k3_ = 0;
  double tangential_ = 0;  ///< |(p1, p2)|
  ImageSize size_;
  double valid_angle_;
  double valid_radius2_;  ///< tan^2 of valid_angle_
};

}  // namespace evpose
