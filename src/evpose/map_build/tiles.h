// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <vector>

#include "evpose/map/cloud_tile.h"
#include "evpose/map_build/line_segment.h"

namespace evpose {
struct ContourMap;
struct PointCloud;
}  // namespace evpose

namespace evpose::map_build {

inline constexpr std::size_t kTileSample = 1 << 18;  ///< points of a cloud that tell where to cut

/// Halves a cloud of so many points across its longer horizontal side, at the median of `sample`, until no
/// tile has more than `most_points`. Each point is held by one tile. `sample`: some of the points, evenly in
/// their order, relative to the anchor.
std::vector<CloudTile> cut_into_tiles(const std::vector<Eigen::Vector3f>& sample, std::size_t points,
                                      double most_points, double overlap_m);

/// Sorts points so that neighbours in space are neighbours in memory, whatever order they came in, and drops
/// those at exactly the same place as another: they say the same. Returns how many were dropped.
std::size_t sort_and_deduplicate(PointCloud& cloud);

/// The points that a tile sees, in their order.
PointCloud points_seen_by(const PointCloud& cloud, const CloudTile& tile);

/// The part of a segment that lies in a tile's core.
std::optional<LineSegment> clipped(const LineSegment& segment, const CloudTile& tile);

/// Adds the map of a tile to that of the tiles before it, as a page; nothing if nothing is in it. Both have
/// one anchor, and contours that are numbered in the order of their points.
void append_tile(const ContourMap& tile, ContourMap& whole);

}  // namespace evpose::map_build
