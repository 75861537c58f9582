// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>

#include "evpose/core/error.h"
#include "evpose/core/pose.h"
#include "evpose/map/contour_map.h"
#include "evpose/map/place_table.h"

namespace evpose {

/// map.h5 1.0: contours, points, planes with their polygons and the mesh of occluders; without a mesh the
/// polygons are the occluders, triangulated. A contour of one row is an isolated point, as is a row that
/// belongs to no contour; lengths of points that the file does not state are shares of their contour's.
/// Errors: not a map file, another major version or unit, an unknown required feature, a dataset whose
/// checksum, shape or content is wrong (named).
Expected<ContourMap> read_map_h5(const std::string& path);

/// Where a map lies in the world.
struct MapPlacement {
  std::optional<Pose> T_ned_map;  ///< local north-east-down from the map; unset: x east, y north, z up
  std::optional<Eigen::Vector3d> origin_llh;  ///< of the local frame: degrees, degrees, m above the ellipsoid
};

/// What the map file says of it; nothing where it lies as a map does by default, or is no map file. Errors:
/// T_ned_map is no rigid transform, origin_llh no place on earth.
Expected<MapPlacement> read_map_placement(const std::string& path);

/// ContourMap::board of that file; empty for what is no map file.
Expected<std::string> read_map_board(const std::string& path);

/// Contours are numbered anew, in the order of their first points; points of one contour that differ in kind,
/// planes or contrast become several. The mesh of occluders is written unless there are polygons to make it
/// of. `created_utc`: ISO 8601 with Z, or empty; part of the file's bytes. `places`: of the map
/// in_file_order().
Status write_map_h5(const std::string& path, const ContourMap& map, const std::string& created_utc = "",
                    const MapPlacement& placement = {}, const PlaceTable* places = nullptr);

/// The map with its points in the order that they have in a file.
ContourMap in_file_order(ContourMap map);

}  // namespace evpose
