// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <random>

#include "evpose/core/parallel.h"
#include "evpose/map_build/map_builder.h"
#include "evpose/map_build/neighbours.h"

namespace evpose::map_build {

inline constexpr double kNoise = 0.015;

/// Points of rectangles, each noisy across its surface, as scans from everywhere would have them.
class Scan {
 public:
  explicit Scan(unsigned seed) : random_(seed) {}

  Scan& rectangle(const Eigen::Vector3d& corner, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                  double per_m2 = 2500) {
    std::uniform_real_distribution<double> share(0, 1);
    std::normal_distribution<double> noise(0, kNoise);
    const Eigen::Vector3d normal = a.cross(b).normalized();
    const auto count = static_cast<int>(per_m2 * a.cross(b).norm());
    for (int i = 0; i < count; ++i) {
      const double u = share(random_), v = share(random_);
      cloud_.points.push_back((corner + u * a + v * b + noise(random_) * normal).cast<float>());
    }
    return *this;
  }
  /// The mantle of an upright cylinder, as far as `turn_rad` of it.
  Scan& cylinder(const Eigen::Vector3d& foot, double radius, double height, double per_m2 = 2500,
                 double turn_rad = 2 * std::numbers::pi) {
    std::uniform_real_distribution<double> share(0, 1);
    std::normal_distribution<double> noise(0, kNoise);
    const auto count = static_cast<int>(per_m2 * turn_rad * radius * height);
    for (int i = 0; i < count; ++i) {
      const double angle = turn_rad * share(random_), r = radius + noise(random_);
      const Eigen::Vector3d on(r * std::cos(angle), r * std::sin(angle), height * share(random_));
      cloud_.points.push_back((foot + on).cast<float>());
    }
    return *this;
  }
  /// A level plate, as far as `inside` says it reaches.
  template <class Inside>
  Scan& plate(double half_size, double height, double per_m2, const Inside& inside) {
    std::uniform_real_distribution<double> share(-half_size, half_size);
    std::normal_distribution<double> noise(0, kNoise);
    const auto count = static_cast<int>(per_m2 * 4 * half_size * half_size);
    for (int i = 0; i < count; ++i) {
      const double x = share(random_), y = share(random_);
      if (inside(x, y)) cloud_.points.push_back(Eigen::Vector3d(x, y, height + noise(random_)).cast<float>());
    }
    return *this;
  }
  PointCloud cloud() const { return cloud_; }

 private:
  std::mt19937 random_;
  PointCloud cloud_;
};

/// Floor and two walls that meet at the origin, turned so that nothing lies along an axis.
inline PointCloud room_corner(unsigned seed) {
  Scan scan(seed);
  scan.rectangle({0, 0, 0}, {1.5, 0, 0}, {0, 1.2, 0});
  scan.rectangle({0, 0, 0}, {0, 1.2, 0}, {0, 0, 1});
  scan.rectangle({0, 0, 0}, {0, 0, 1}, {1.5, 0, 0});
  return scan.cloud();
}

inline SurfacePoints described(std::vector<Eigen::Vector3f> points) {
  ThreadPool pool(2);
  const Neighbours tree(points);
  const auto scale = measure_scale(points, tree, {}, "scan");
  return describe_surface(std::move(points), tree, *scale, {}, pool);
}

inline Expected<BuiltMap> build(const PointCloud& cloud, int threads = 1) {
  ThreadPool pool(threads);
  return build_map(cloud, {}, pool, [](double) { return true; });
}

}  // namespace evpose::map_build
