// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace evpose::map_build {

/// Finds the nearest points of a set. Queries may run in several threads at once.
class Neighbours {
 public:
  /// The points must stay where they are.
  explicit Neighbours(std::span<const Eigen::Vector3f> points);
  ~Neighbours();
  Neighbours(const Neighbours&) = delete;
  Neighbours& operator=(const Neighbours&) = delete;

  /// Numbers of the `indices.size()` points nearest to `p`, nearest first (a point of the set finds itself),
  /// and the squares of their distances (of the same length). Returns how many there are.
  std::size_t nearest(const Eigen::Vector3f& p, std::span<std::uint32_t> indices,
                      std::span<float> squares) const;

  /// True if a point is nearer to `p` than `reach_m`.
  bool any_within(const Eigen::Vector3d& p, double reach_m) const;

  /// Numbers of the points within `radius_m` of `p`, in an order that depends on the points alone.
  void within(const Eigen::Vector3f& p, float radius_m, std::vector<std::uint32_t>& out) const;

 private:
  struct Tree;
  std::unique_ptr<Tree> tree_;
};

}  // namespace evpose::map_build
