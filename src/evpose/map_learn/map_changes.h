// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

#include "evpose/map/contour_map.h"

namespace evpose::map_learn {

enum class Change { moved, gone, added };
inline constexpr std::array<const char*, 3> kChangeNames{"moved", "gone", "new"};

/// A piece of contour, up to 12 cm long, that is not the same in two maps.
struct ContourChange {
  Change change = Change::moved;
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();  ///< of it where it was, or is if it is new; map frame, m
  Eigen::Vector3d moved_m = Eigen::Vector3d::Zero();  ///< from there to where it is, across it
  double sigma_m = 0;                                 ///< of the place across it, both maps
  double length_m = 0;
};

struct MapChanges {
  std::vector<ContourChange> changes;  ///< by kind, then by place
  double same_m = 0;                   ///< of the old map

  /// Of one kind.
  std::size_t count(Change change) const;
  double length_m(Change change) const;
  double median_moved_m() const;
};

struct ChangeConfig {
  double farthest_m = 0.1;  ///< that a contour may have moved and still be called the same one
  double least_m = 3e-3;    ///< move that is told, beside three sigmas
};

/// What differs between two maps of one frame. A piece is the same if the other map has one beside it, nearly
/// parallel, that no other piece is nearer to.
MapChanges compare_dates(const ContourMap& before, const ContourMap& after, const ChangeConfig& config = {});

}  // namespace evpose::map_learn
