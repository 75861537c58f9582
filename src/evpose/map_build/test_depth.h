// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <random>
#include <vector>

#include "evpose/map/point_cloud.h"
#include "evpose/map_build/depth_fusion.h"

namespace evpose::map_build {

/// A depth camera of 320 x 240 pixels before rectangles.
class DepthScene {
 public:
  explicit DepthScene(unsigned seed) : random_(seed) {
    CameraIntrinsics intrinsics{260, 260, 159.5, 119.5, "none", {}, {320, 240}};
    camera_ = make_camera(intrinsics).value();
    rays_ = rays_of_unit_depth(*camera_);
  }

  DepthScene& rectangle(const Eigen::Vector3d& corner, const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
    faces_.push_back({corner, a, b});
    return *this;
  }

  /// Depths in units of `step_m`, with noise of `sigma_m(depth)` before they are rounded.
  std::vector<std::uint16_t> image(const Pose& T_map_cam, double step_m,
                                   const std::function<double(double)>& sigma_m) {
    std::normal_distribution<double> normal(0, 1);
    std::vector<std::uint16_t> out;
    for (const auto& ray : rays_) {
      const double z = depth_m(T_map_cam, ray.cast<double>());
      const double noisy = z > 0 ? z + sigma_m(z) * normal(random_) : 0;
      out.push_back(static_cast<std::uint16_t>(std::lround(std::max(noisy, 0.0) / step_m)));
    }
    return out;
  }
  std::vector<DepthSample> samples(const Pose& T_map_cam, const DepthFusionConfig& config) {
    const auto depth = image(T_map_cam, config.noise.step_m, [&](double z) {
      return config.noise.least_m + config.noise.growth_per_m * z * z;
    });
    return samples_of({camera_->size(), depth}, rays_, camera_->focal_px(), config);
  }

  const std::vector<Eigen::Vector3f>& rays() const { return rays_; }
  const Camera& camera() const { return *camera_; }

  /// At `eye`, with the image's middle at `target`, upright.
  static Pose looking(const Eigen::Vector3d& eye, const Eigen::Vector3d& target) {
    Eigen::Matrix3d axes;
    axes.col(2) = (target - eye).normalized();
    axes.col(0) = axes.col(2).cross(Eigen::Vector3d::UnitZ()).normalized();
    axes.col(1) = axes.col(2).cross(axes.col(0));
    return {Eigen::Quaterniond(axes), eye};
  }

 private:
  struct Face {
    Eigen::Vector3d corner, a, b;
  };
  double depth_m(const Pose& T_map_cam, const Eigen::Vector3d& ray) const {
    double nearest = 0;
    const Eigen::Vector3d direction = T_map_cam.q * ray;
    for (const Face& face : faces_) {
      const Eigen::Vector3d normal = face.a.cross(face.b);
      const double z = normal.dot(face.corner - T_map_cam.p) / normal.dot(direction);
      const Eigen::Vector3d on = T_map_cam.p + z * direction - face.corner;
      const double u = on.dot(face.a) / face.a.squaredNorm(), v = on.dot(face.b) / face.b.squaredNorm();
      if (z > 0 && u >= 0 && u <= 1 && v >= 0 && v <= 1 && (nearest == 0 || z < nearest)) nearest = z;
    }
    return nearest;
  }

  std::mt19937 random_;
  std::shared_ptr<const Camera> camera_;
  std::vector<Eigen::Vector3f> rays_;
  std::vector<Face> faces_;
};

/// Floor and two walls that meet at the origin.
inline DepthScene depth_corner(unsigned seed) {
  DepthScene scene(seed);
  scene.rectangle({0, 0, 0}, {2, 0, 0}, {0, 2, 0})
      .rectangle({0, 0, 0}, {0, 2, 0}, {0, 0, 2})
      .rectangle({0, 0, 0}, {0, 0, 2}, {2, 0, 0});
  return scene;
}

inline std::vector<Pose> poses_before_corner(int count) {
  std::vector<Pose> out;
  for (int k = 0; k < count; ++k) {
    const double turn = 0.4 + 0.8 * k / std::max(1, count - 1);
    out.push_back(DepthScene::looking({2.2 * std::cos(turn), 2.2 * std::sin(turn), 1.1 + 0.25 * (k % 3)},
                                      {0.3, 0.3, 0.4}));
  }
  return out;
}

inline PointCloud cloud_of(const std::vector<MeasuredPoint>& points) {
  PointCloud cloud;
  for (const MeasuredPoint& point : points) cloud.points.push_back(point.position.cast<float>());
  return cloud;
}

}  // namespace evpose::map_build
