// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/maps/map_places.h"

#include <utility>

#include "evpose/io/hdf5/hdf5_file.h"
#include "evpose/io/maps/map_columns.h"

namespace evpose {

Expected<std::optional<PlaceTable>> read_map_places(const std::string& path) {
  if (!is_hdf5_file(path)) return std::optional<PlaceTable>();
  const auto file = Hdf5File::open(path);
  if (!file) return file.error();
  if (!file->has("/places")) return std::optional<PlaceTable>();
  MapColumns columns(*file);
  PlaceTable out;
  const auto map = columns.column<std::uint64_t>("/places/map", 1, 1);
  const auto view = columns.column<double>("/places/view", 1, 3);
  const auto box = columns.column<double>("/places/box", 3, 2);
  out.looked_at = columns.column<std::uint32_t>("/places/looked_at", 1, -1);
  out.seen = columns.column<std::uint8_t>("/places/seen", 1, -1);
  if (!columns.status()) return columns.status().error();
  std::uint64_t bytes = 0;
  for (const std::uint32_t count : out.looked_at)
    if (count != PlaceTable::kNoPlace) bytes += (std::uint64_t{count} + 7) / 8;
  if (bytes != out.seen.size())
    return Error{file->path() + ": /places",
                 text("has ", out.seen.size(), " bytes of bits instead of ", bytes), kMapDamaged};
  out.view = map.front();
  out.near_m = view[0];
  out.far_m = view[1];
  out.grazing_sin = view[2];
  out.box = {Eigen::Vector3d(box[0], box[1], box[2]), Eigen::Vector3d(box[3], box[4], box[5])};
  return std::optional(std::move(out));
}

}  // namespace evpose
