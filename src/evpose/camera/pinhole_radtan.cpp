// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/camera/pinhole_radtan.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "evpose/camera/fold.h"

namespace evpose {
namespace {

// Nearer to the image plane than this a pinhole's pixel says nothing about the direction.
constexpr double kMaxAngle = 89.9 * std::numbers::pi / 180;

double square(double a) { return a * a; }

}  // namespace

PinholeRadtan::PinholeRadtan(const CameraIntrinsics& intrinsics)
    : fx_(intrinsics.fx),
      fy_(intrinsics.fy),
      cx_(intrinsics.cx),
      cy_(intrinsics.cy),
      distorted_(!intrinsics.distortion.empty()),
      size_(intrinsics.size) {
  if (distorted_) {
    const std::vector<double>& d = intrinsics.distortion;
    k1_ = d[0], k2_ = d[1], p1_ = d[2], p2_ = d[3];
    if (d.size() > 4) k3_ = d[4];
  }
  tangential_ = std::hypot(p1_, p2_);
  valid_angle_ = fold_angle([this](double angle) { return least_determinant(std::tan(angle)); }, kMaxAngle);
  valid_radius2_ = square(std::tan(valid_angle_));
}

double PinholeRadtan::focal_px() const { return std::sqrt(fx_ * fy_); }

// In polar coordinates the potential is F(r) + r^3 |p| cos(a), p = (p2, p1), a the angle between m and p. Its
// Hessian there is [F'' + 6 r|p| cos a, -2 r|p| sin a; ., F'/r + 2 r|p| cos a]: the determinant is a parabola
// in cos a, least at its vertex or at an end of [-1, 1].
double PinholeRadtan::least_determinant(double r) const {
  const double r2 = r * r;
  const double across = 1 + r2 * (k1_ + r2 * (k2_ + r2 * k3_));             // F' / r
  const double along = 1 + r2 * (3 * k1_ + r2 * (5 * k2_ + r2 * 7 * k3_));  // F''
  if (!(across > 0) || !(along > 0)) return -1;
  const double tangential = r * tangential_;
  const double slope = 2 * tangential * (along + 3 * across);
  const double curvature = 16 * square(tangential);
  const double c = curvature > 0 ? std::max(-1.0, -slope / (2 * curvature)) : 0;
  // Two negative eigenvalues have a positive product: the diagonal must be positive as well.
  if (!(along - 6 * tangential > 0)) return -1;
  return along * across - 4 * square(tangential) + c * (slope + curvature * c);
}

Eigen::Vector2d PinholeRadtan::distort(const Eigen::Vector2d& m, Eigen::Matrix2d* jacobian) const {
  const double x = m.x(), y = m.y(), r2 = m.squaredNorm();
  const double radial = 1 + r2 * (k1_ + r2 * (k2_ + r2 * k3_));
  if (jacobian) {
    const double slope = 2 * (k1_ + r2 * (2 * k2_ + r2 * 3 * k3_));  // d radial / d r2, times 2
    const double mixed = slope * x * y + 2 * (p1_ * x + p2_ * y);
    *jacobian << radial + slope * x * x + 2 * p1_ * y + 6 * p2_ * x, mixed,  //
        mixed, radial + slope * y * y + 6 * p1_ * y + 2 * p2_ * x;
  }
  return {x * radial + 2 * p1_ * x * y + p2_ * (r2 + 2 * x * x),
          y * radial + p1_ * (r2 + 2 * y * y) + 2 * p2_ * x * y};
}

std::optional<Eigen::Vector2d> PinholeRadtan::project(const Eigen::Vector3d& point,
                                                      Matrix23d* jacobian) const {
  if (!(point.z() > 0)) return std::nullopt;
  const double inverse_z = 1 / point.z();
  const Eigen::Vector2d m = point.head<2>() * inverse_z;
  if (!(m.squaredNorm() < valid_radius2_)) return std::nullopt;
  Eigen::Matrix2d distortion;
  const Eigen::Vector2d distorted = distort(m, jacobian ? &distortion : nullptr);
  if (jacobian) {
    const Eigen::Matrix2d scaled = Eigen::Vector2d(fx_, fy_).asDiagonal() * distortion * inverse_z;
    *jacobian << scaled, -scaled * m;
  }
  return Eigen::Vector2d(fx_ * distorted.x() + cx_, fy_ * distorted.y() + cy_);
}

// Newton's method on the gradient of a convex potential, each step halved until it stays inside the domain
// and brings the pixel nearer.
std::optional<Eigen::Vector3d> PinholeRadtan::unproject(const Eigen::Vector2d& pixel) const {
  constexpr double kConverged_px = 1e-9, kBest_px = 1e-12;
  const Eigen::Vector2d focal(fx_, fy_);
  const Eigen::Vector2d wanted((pixel.x() - cx_) / fx_, (pixel.y() - cy_) / fy_);
  if (!wanted.allFinite()) return std::nullopt;
  Eigen::Vector2d m = wanted;
  if (m.squaredNorm() >= valid_radius2_) m *= 0.9 * std::sqrt(valid_radius2_) / m.norm();
  Eigen::Matrix2d jacobian;
  Eigen::Vector2d missing = wanted - distort(m, &jacobian);
  double miss_px = missing.cwiseProduct(focal).norm();
  for (int i = 0; i < 60 && miss_px > kBest_px; ++i) {
    const Eigen::Vector2d step = jacobian.inverse() * missing;
    bool nearer = false;
    for (double scale = 1; scale > 1e-6 && !nearer; scale *= 0.5) {
      const Eigen::Vector2d next = m + scale * step;
      if (!(next.squaredNorm() < valid_radius2_)) continue;
      Eigen::Matrix2d next_jacobian;
      const Eigen::Vector2d next_missing = wanted - distort(next, &next_jacobian);
      const double next_px = next_missing.cwiseProduct(focal).norm();
      nearer = next_px < miss_px;
      if (nearer) m = next, missing = next_missing, miss_px = next_px, jacobian = next_jacobian;
    }
    if (!nearer) break;
  }
  if (!(miss_px < kConverged_px)) return std::nullopt;
  return Eigen::Vector3d(m.x(), m.y(), 1).normalized();
}

}  // namespace evpose
