// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <vector>

#include "evpose/map_build/line_segment.h"

namespace evpose {
struct PointCloud;
}

namespace evpose::map_build {

/// An upright column of a cloud: what it answers for, without its high borders, and how far it looks beyond.
struct Tile {
  Eigen::Vector2f low, high;  ///< relative to the cloud's anchor; infinite at the cloud's rim
  float overlap_m = 0;

  bool holds(const Eigen::Vector3f& p, float margin_m = 0) const {
    return p.x() >= low.x() - margin_m && p.y() >= low.y() - margin_m && p.x() < high.x() + margin_m &&
           p.y() < high.y() + margin_m;
  }
};

/// Halves the cloud across its longer horizontal side, at the median of a sample, until no tile has more than
/// `most_points`. Each point is held by one tile.
std::vector<Tile> cut_into_tiles(const std::vector<Eigen::Vector3f>& points, double most_points,
                                 double overlap_m);

/// Sorts points so that neighbours in space are neighbours in memory, whatever order they came in, and drops
/// those at exactly the same place as another: they say the same. Returns how many were dropped.
std::size_t sort_and_deduplicate(PointCloud& cloud);

/// The points that a tile sees, in their order.
PointCloud points_seen_by(const PointCloud& cloud, const Tile& tile);

/// The part of a segment that lies in a tile's core.
std::optional<LineSegment> clipped(const LineSegment& segment, const Tile& tile);

}  // namespace evpose::map_build
