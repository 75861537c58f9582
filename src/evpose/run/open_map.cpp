// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/run/open_map.h"

#include <utility>

#include "evpose/core/log.h"
#include "evpose/io/maps/contour_files.h"
#include "evpose/io/maps/map_pages.h"
#include "evpose/io/maps/point_table.h"

namespace evpose {
namespace {

Expected<OpenedMap> open_whole(const std::string& path) {
  auto map = read_contour_map(path);
  if (!map) return map.error();
  return OpenedMap{std::make_shared<const ContourMap>(*std::move(map)), {}};
}

}  // namespace

Expected<OpenedMap> open_map(const std::string& path, const Eigen::Vector3d& start_map,
                             const TrackerConfig& config) {
  const auto kind = point_file_kind(path);
  if (!kind) return kind.error();
  if (*kind != PointFileKind::hdf5) return open_whole(path);
  auto opened = MapPages::open(path);
  if (!opened) return opened.error();
  if (!opened->divided()) return open_whole(path);
  const auto pages = std::make_shared<const MapPages>(*std::move(opened));
  const double radius_m = part_radius_m(config);
  auto part = pages->around(start_map, radius_m);
  if (!part) return part.error();
  if ((*part)->points.empty())
    return Error{
        "start pose",
        text("the map has nothing within ", radius_m, " m of (", start_map.x(), ", ", start_map.y(), ")"),
        "check that map and start pose share one frame (frames.T_map_world in recording.yaml)"};
  const MapParts parts = [pages](const Eigen::Vector3d& place_map, double radius) {
    auto read = pages->around(place_map, radius);
    if (!read) log_warning(read.error().line());
    return read ? *std::move(read) : nullptr;
  };
  return OpenedMap{*std::move(part), parts};
}

}  // namespace evpose
