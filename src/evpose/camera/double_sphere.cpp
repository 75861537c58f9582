// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/camera/double_sphere.h"

#include <cmath>
#include <numbers>

#include "evpose/camera/fold.h"

namespace evpose {

DoubleSphere::DoubleSphere(const CameraIntrinsics& intrinsics)
    : fx_(intrinsics.fx),
      fy_(intrinsics.fy),
      cx_(intrinsics.cx),
      cy_(intrinsics.cy),
      xi_(intrinsics.distortion[0]),
      alpha_(intrinsics.distortion[1]),
      size_(intrinsics.size) {
  valid_angle_ = fold_angle([this](double angle) { return slope(angle); }, std::numbers::pi);
}

// On the axis m' = (x, y) / z * 1 / (1 + xi).
double DoubleSphere::focal_px() const { return std::sqrt(fx_ * fy_) / (1 + xi_); }

/// Sign of d radius / d angle, and not positive where the denominator is not.
double DoubleSphere::slope(double angle) const {
  const double s = std::sin(angle), c = std::cos(angle), w = xi_ + c, e = std::hypot(s, w);
  const double denominator = alpha_ * e + (1 - alpha_) * w;
  if (!(denominator > 0)) return -1;
  // d w = -s, d e = (s c - w s) / e = -s xi / e.
  const double change = -alpha_ * s * xi_ / e - (1 - alpha_) * s;
  return c * denominator - s * change;
}

std::optional<Eigen::Vector2d> DoubleSphere::project(const Eigen::Vector3d& point,
                                                     Matrix23d* jacobian) const {
  const double d = point.norm();
  if (!std::isfinite(d) || !(d > 0)) return std::nullopt;
  const Eigen::Vector2d off_axis = point.head<2>();
  if (!(std::atan2(off_axis.norm(), point.z()) < valid_angle_)) return std::nullopt;
  const double w = xi_ * d + point.z(), e = std::hypot(off_axis.norm(), w);
  const double denominator = alpha_ * e + (1 - alpha_) * w;
  if (!(denominator > 0)) return std::nullopt;
  if (jacobian != nullptr) {
    const Eigen::RowVector3d dw = xi_ * point.transpose() / d + Eigen::RowVector3d(0, 0, 1);
    const Eigen::RowVector3d de = (Eigen::RowVector3d(point.x(), point.y(), 0) + w * dw) / e;
    const Eigen::RowVector3d change = alpha_ * de + (1 - alpha_) * dw;
    *jacobian << Eigen::Matrix2d::Identity() / denominator, Eigen::Vector2d::Zero();
    *jacobian -= off_axis / (denominator * denominator) * change;
    *jacobian = Eigen::Vector2d(fx_, fy_).asDiagonal() * *jacobian;
  }
  return Eigen::Vector2d(fx_ * off_axis.x() / denominator + cx_, fy_ * off_axis.y() / denominator + cy_);
}

std::optional<Eigen::Vector3d> DoubleSphere::unproject(const Eigen::Vector2d& pixel) const {
  const Eigen::Vector2d m((pixel.x() - cx_) / fx_, (pixel.y() - cy_) / fy_);
  const double r2 = m.squaredNorm();
  const double under_root = 1 - (2 * alpha_ - 1) * r2;
  if (!std::isfinite(r2) || under_root < 0) return std::nullopt;
  // Towards the second sphere's centre the ray is (m, k), of which the first sphere takes its share.
  const double k = (1 - alpha_ * alpha_ * r2) / (alpha_ * std::sqrt(under_root) + 1 - alpha_);
  const double square = k * k + (1 - xi_ * xi_) * r2;
  if (square < 0) return std::nullopt;
  const double scale = (k * xi_ + std::sqrt(square)) / (k * k + r2);
  const Eigen::Vector3d ray = Eigen::Vector3d(scale * m.x(), scale * m.y(), scale * k - xi_).normalized();
  const auto back = project(ray, nullptr);  // the closed form has a second branch beyond the fold
  if (!back || !((*back - pixel).norm() < 1e-9 * (1 + pixel.norm()))) return std::nullopt;
  return ray;
}

}  // namespace evpose
