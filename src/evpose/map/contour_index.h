// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "evpose/map/contour_map.h"

namespace evpose {

/// A map's points sorted into cubes, so that a query touches only the cubes near a view: its cost does not
/// grow with the map.
class ContourIndex {
 public:
  /// Keeps `map`, which must outlive it, and whose view-dependent contours are left out. `cube_m`: edge of a
  /// cube.
  explicit ContourIndex(const ContourMap& map, double cube_m = 0.5);

  /// Inside a cube the points come from coarse to fine: first some that lie 16 cm apart along the contours,
  /// then those that make it 8 cm, and so on.
  static constexpr int kLevels = 5;
  static constexpr float kCoarsest_m = 0.16F;

  struct Cube {
    Eigen::Vector3f centre;    ///< of its points' bounding box, relative to the map's anchor
    float radius;              ///< of the sphere around its points, metres
    std::uint32_t begin, end;  ///< range of order()
    std::uint32_t level_end[kLevels];

    /// End of a range that begins at `begin` and holds points at about `spacing_m` along every contour.
    std::uint32_t end_for(float spacing_m) const;
  };
  const std::vector<Cube>& cubes() const { return cubes_; }
  /// Point numbers of the map, cube after cube.
  const std::vector<std::uint32_t>& order() const { return order_; }
  const ContourMap& map() const { return *map_; }

  /// Some occluding triangles that lie together.
  struct Occluders {
    Eigen::Vector3f centre;
    float radius;
    std::uint32_t begin, end;  ///< range of occluder_order()
  };
  const std::vector<Occluders>& occluders() const { return occluders_; }
  const std::vector<std::uint32_t>& occluder_order() const { return occluder_order_; }

  /// Numbers of the cubes that meet the sphere, ascending. They are appended to `out`.
  void append_cubes_within(const Eigen::Vector3d& centre_map, double radius_m,
                           std::vector<std::uint32_t>& out) const;

 private:
  /// A block of 8^3 cubes.
  struct BlockRange {
    std::int64_t key;
    std::uint32_t begin, end;  ///< range of cubes_
    Eigen::Vector3f centre;
    float radius;
  };
  void order_coarse_to_fine(Cube& cube);
  void group_occluders();

  const ContourMap* map_;
  float cube_m_;
  std::vector<Cube> cubes_;
  std::vector<BlockRange> blocks_;
  std::vector<std::uint32_t> order_;
  std::vector<Occluders> occluders_;
  std::vector<std::uint32_t> occluder_order_;
};

}  // namespace evpose
