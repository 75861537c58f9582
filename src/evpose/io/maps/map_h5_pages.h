// SPDX-License-Identifier: BSD-3-Clause
// /pages of a map file: which rows of its datasets belong to a part of the map by place.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>
#include <vector>

#include "evpose/core/error.h"
#include "evpose/map/contour_map.h"

namespace evpose {

class Hdf5File;

/// Datasets of a map file by the kind of thing that has a row in them.
enum class MapRows : std::uint8_t { points, contours, planes, polygons, vertices };
inline constexpr std::array<const char*, 5> kMapRowNames{"points", "contours", "planes", "polygons",
                                                         "vertices"};

/// The kind of a dataset's rows, by its name.
constexpr MapRows rows_of_dataset(std::string_view name) {
  if (name == "/polygons/vertices") return MapRows::vertices;
  if (name.starts_with("/polygons/")) return MapRows::polygons;
  if (name.starts_with("/planes/")) return MapRows::planes;
  return name.starts_with("/contours/") ? MapRows::contours : MapRows::points;
}

/// One page: its rows, the horizontal rectangle that holds its contours and surfaces, relative to the anchor,
/// and the checksum of its columns' checksums.
struct MapFilePage {
  std::array<std::uint64_t, 5> first{}, end{};  ///< by MapRows
  Eigen::Vector2f low = Eigen::Vector2f::Zero(), high = Eigen::Vector2f::Zero();
  std::uint32_t crc = 0;

  std::uint64_t end_of(MapRows kind) const { return end[static_cast<std::size_t>(kind)]; }
  std::uint64_t first_of(MapRows kind) const { return first[static_cast<std::size_t>(kind)]; }
  std::uint64_t count_of(MapRows kind) const {
    return end[static_cast<std::size_t>(kind)] - first[static_cast<std::size_t>(kind)];
  }
};

/// Of a file; empty: the map is not divided. Errors: pages that do not follow each other to the end.
Expected<std::vector<MapFilePage>> read_map_pages(const Hdf5File& file);
/// Anchor and frame. Errors: as of read_map_h5().
Status read_map_meta(const Hdf5File& file, ContourMap& map);
/// What a page holds, with the numbers of contours, and of planes in its points, as in the whole. Errors: as
/// of read_map_h5().
Expected<ContourMap> read_map_page(const Hdf5File& file, const MapFilePage& page);

}  // namespace evpose
