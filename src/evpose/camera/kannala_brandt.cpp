// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/camera/kannala_brandt.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "evpose/camera/fold.h"

namespace evpose {

KannalaBrandt::KannalaBrandt(const CameraIntrinsics& intrinsics)
    : fx_(intrinsics.fx), fy_(intrinsics.fy), cx_(intrinsics.cx), cy_(intrinsics.cy), size_(intrinsics.size) {
  std::copy_n(intrinsics.distortion.begin(), k_.size(), k_.begin());
  valid_angle_ = fold_angle([this](double angle) { return radius_slope(angle); }, std::numbers::pi);
}

double KannalaBrandt::focal_px() const { return std::sqrt(fx_ * fy_); }

double KannalaBrandt::radius(double a) const {
  const double a2 = a * a;
  return a * (1 + a2 * (k_[0] + a2 * (k_[1] + a2 * (k_[2] + a2 * k_[3]))));
}

double KannalaBrandt::radius_slope(double a) const {
  const double a2 = a * a;
  return 1 + a2 * (3 * k_[0] + a2 * (5 * k_[1] + a2 * (7 * k_[2] + a2 * 9 * k_[3])));
}

std::optional<Eigen::Vector2d> KannalaBrandt::project(const Eigen::Vector3d& point,
                                                      Matrix23d* jacobian) const {
  const double z = point.z();
  const double off_axis = std::hypot(point.x(), point.y());
  const double distance2 = off_axis * off_axis + z * z;
  if (!std::isfinite(distance2) || !(distance2 > 0)) return std::nullopt;
  const double angle = std::atan2(off_axis, z);
  if (!(angle < valid_angle_)) return std::nullopt;

  // On the axis any direction will do: both scales agree there.
  const bool on_axis = !(off_axis > 0);
  const Eigen::Vector2d direction =
      on_axis ? Eigen::Vector2d(1, 0) : Eigen::Vector2d(point.head<2>() / off_axis);
  const double scale = on_axis ? 1 / z : radius(angle) / off_axis;
  if (jacobian) {
    const double slope = radius_slope(angle) / distance2;
    const Eigen::Matrix2d radial = direction * direction.transpose();
    const Eigen::Matrix2d lateral = scale * (Eigen::Matrix2d::Identity() - radial) + slope * z * radial;
    *jacobian << lateral, -slope * off_axis * direction;
    *jacobian = Eigen::Vector2d(fx_, fy_).asDiagonal() * *jacobian;
  }
  return Eigen::Vector2d(fx_ * scale * point.x() + cx_, fy_ * scale * point.y() + cy_);
}

// The radius grows strictly on [0, valid angle]: Newton's method, with bisection where a step leaves the
// bracket.
std::optional<Eigen::Vector3d> KannalaBrandt::unproject(const Eigen::Vector2d& pixel) const {
  constexpr double kConverged_px = 1e-9;
  const Eigen::Vector2d wanted((pixel.x() - cx_) / fx_, (pixel.y() - cy_) / fy_);
  const double wanted_radius = wanted.norm();
  if (!(wanted_radius < radius(valid_angle_))) return std::nullopt;
  if (!(wanted_radius > 0)) return Eigen::Vector3d(0, 0, 1);
  double low = 0, high = valid_angle_;
  double angle = std::min(wanted_radius, 0.5 * high);
  double excess = radius(angle) - wanted_radius;
  for (int i = 0; i < 200 && excess != 0; ++i) {
    (excess < 0 ? low : high) = angle;
    double next = angle - excess / radius_slope(angle);
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    if (next == angle || next == low || next == high) break;
    angle = next;
    excess = radius(angle) - wanted_radius;
  }
  if (!(std::abs(excess) * std::max(fx_, fy_) < kConverged_px)) return std::nullopt;
  const Eigen::Vector2d direction = wanted / wanted_radius;
  return Eigen::Vector3d(std::sin(angle) * direction.x(), std::sin(angle) * direction.y(), std::cos(angle));
}

}  // namespace evpose
