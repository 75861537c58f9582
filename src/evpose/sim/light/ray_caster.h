// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "evpose/core/pose.h"
#include "evpose/sim/world/scene.h"

namespace evpose::sim {

/// Where a ray meets a surface: origin + distance * direction.
struct RayHit {
  float distance;          ///< in lengths of the direction
  std::int32_t part;       ///< -1: what stands still; else number in Scene::moving
  std::uint32_t triangle;  ///< of the part's mesh
};

/// Rays in a scene, by Embree. May be used from several threads at once.
class RayCaster {
 public:
  /// Keeps a reference.
  explicit RayCaster(const Scene& scene);
  ~RayCaster();

  /// First surface in (near, far), lengths of `direction`, of what stands still. Map frame.
  std::optional<RayHit> trace(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, float near = 0,
                              float far = std::numeric_limits<float>::infinity()) const;
  /// Rays from one place, of which neighbours go much the same way: what trace() says of each, faster.
  /// `triangle` is kNoTriangle where nothing is met.
  static constexpr std::uint32_t kNoTriangle = 0xFFFFFFFF;
  struct BatchHit {
    float distance;
    std::uint32_t triangle;
  };
  void trace_batch(const Eigen::Vector3d& origin, std::span<const Eigen::Vector3f> directions,
                   std::span<BatchHit> hits) const;
  /// Where the moving parts stand at a time: T_map_part of each.
  std::vector<Pose> parts_at(double t_s) const;
  /// Moving parts too, as they stand.
  std::optional<RayHit> trace(const std::vector<Pose>& T_map_part, const Eigen::Vector3d& origin,
                              const Eigen::Vector3d& direction, float near = 0,
                              float far = std::numeric_limits<float>::infinity()) const;
  /// One part alone, in its own frame.
  std::optional<RayHit> trace_part(int part, const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                                   float near, float far) const;
  /// True if what stands still covers the way.
  bool blocked(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, float near, float far) const;

  const Scene& scene() const { return scene_; }

 private:
  struct Impl;
  const Scene& scene_;
  std::unique_ptr<Impl> impl_;
};

}  // namespace evpose::sim
