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
  std::int32_t part;       ///< -1: static; else number in Scene::moving
  std::uint32_t triangle;  ///< of the part's mesh
};

/// Ray casting in a scene by Embree. May be used from several threads at once.
class RayCaster {
 public:
  /// Keeps a reference.
  explicit RayCaster(const Scene& scene);
  ~RayCaster();

  /// First static surface in (near, far), in lengths of `direction`. Map frame.
  std::optional<RayHit> trace(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, float near = 0,
                              float far = std::numeric_limits<float>::infinity()) const;
  /// Traces coherent rays from one origin; the same results as trace(), faster. `triangle` is kNoTriangle
  /// where nothing is hit.
  static constexpr std::uint32_t kNoTriangle = 0xFFFFFFFF;
  struct BatchHit {
    float distance;
    std::uint32_t triangle;
  };
  void trace_batch(const Eigen::Vector3d& origin, std::span<const Eigen::Vector3f> directions,
                   std::span<BatchHit> hits) const;
  /// The same for one moving part alone, in its own frame.
  void trace_part_batch(int part, const Eigen::Vector3d& origin, std::span<const Eigen::Vector3f> directions,
                        std::span<BatchHit> hits) const;
  /// Poses of the moving parts at a time: T_map_part of each.
  std::vector<Pose> parts_at(double t_s) const;
  /// First surface, moving parts included.
  std::optional<RayHit> trace(const std::vector<Pose>& T_map_part, const Eigen::Vector3d& origin,
                              const Eigen::Vector3d& direction, float near = 0,
                              float far = std::numeric_limits<float>::infinity()) const;
  /// True if a static surface lies in between.
  bool occluded(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, float near, float far) const;

  struct Segment {
    Eigen::Vector3f direction;
    float near, far;  ///< in lengths of the direction
  };
  /// Which of up to eight segments from one origin meet no static surface: bit i for segment i. Much faster
  /// than occluded() for each.
  static constexpr std::size_t kMostSegments = 8;
  unsigned free_segments(const Eigen::Vector3d& origin, std::span<const Segment> segments) const;
  /// The same from an origin for each.
  unsigned free_segments(std::span<const Eigen::Vector3d> origins, std::span<const Segment> segments) const;

  const Scene& scene() const { return scene_; }

 private:
  struct Impl;
  const Scene& scene_;
  std::unique_ptr<Impl> impl_;
};

}  // namespace evpose::sim
