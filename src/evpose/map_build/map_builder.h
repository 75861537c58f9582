// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <functional>
#include <optional>
#include <string>

#include "evpose/core/error.h"
#include "evpose/map/cloud_tile.h"
#include "evpose/map/contour_map.h"
#include "evpose/map/point_cloud.h"
#include "evpose/map_build/boundaries.h"
#include "evpose/map_build/creases.h"
#include "evpose/map_build/planes.h"
#include "evpose/map_build/surface_points.h"

namespace evpose {
class ConfigTable;
class ThreadPool;
}  // namespace evpose

namespace evpose::map_build {

struct BuildConfig {
  PatchConfig patch;
  PlaneConfig plane;
  CreaseConfig crease;
  BoundaryConfig boundary;
  double point_spacing_m = 0.02;  ///< of the contours' points in the map
  double tile_points = 4e6;       ///< larger clouds are worked on in tiles of about so many points
  double tile_overlap_m = 1;      ///< width of the border in which a tile sees its neighbours
};
void describe(ConfigTable& table, BuildConfig& config);

/// What a build found, for people.
struct BuildFigures {
  std::size_t tiles = 0;
  std::size_t points = 0, duplicates = 0, in_planes = 0, planes = 0, curved = 0;
  CloudScale scale;
  std::size_t cylinders = 0, poles = 0;           ///< whose axes are in the map
  std::array<double, kContourKinds> by_kind_m{};  ///< lengths in the map
  double left_out_m = 0;                          ///< of outlines and creases: short or unsure
  double normals_s = 0, planes_s = 0;             ///< elapsed in these steps
};

struct BuiltMap {
  ContourMap map;
  BuildFigures figures;
};

/// From points to planes to contours (EV-Pose, Map Construction; design 5.10). The same for any number of
/// threads. Clouds of more than `tile_points` are worked on in upright tiles, one after the other; beyond the
/// cloud itself the memory is that of a tile. Contours end at the tiles' borders and go on beyond them; the
/// scale is measured in each tile. `progress` is told the share done, 0..1; the work is given up with an
/// error when it returns false. Errors: too few points, on lines or spots, or so sparse that nothing is flat;
/// no plane or no contour is found.
Expected<BuiltMap> build_map(PointCloud cloud, const BuildConfig& config, ThreadPool& pool,
                             const std::function<bool(double)>& progress);

/// Of one tile of a larger cloud, by itself: what build_map() would append for it. `cloud` has the points
/// that the tile sees, and no viewpoints. Errors: interrupted; nothing flat.
Expected<BuiltMap> build_tile(PointCloud cloud, const CloudTile& tile, const BuildConfig& config,
                              ThreadPool& pool, const std::function<bool(double)>& progress);

/// What is left to do for a map when all of its tiles are appended: what hides. Error: it has no contour.
Status complete_map(ContourMap& map);

}  // namespace evpose::map_build
