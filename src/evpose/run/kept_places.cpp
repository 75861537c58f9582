// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/run/kept_places.h"

#include <utility>

#include "evpose/io/maps/map_places.h"

namespace evpose {

Expected<std::shared_ptr<PlaceCache>> kept_places(const std::string& path, const ContourMap& map,
                                                  std::vector<Error>& findings) {
  auto table = read_map_places(path);
  if (!table) return table.error();
  if (!*table) return std::shared_ptr<PlaceCache>();
  if ((*table)->view == view_fingerprint(map)) return std::make_shared<PlaceCache>(**std::move(table));
  findings.push_back({path, "what is seen from its places is of the map before it was changed",
                      "make it anew: evpose map index"});
  return std::shared_ptr<PlaceCache>();
}

}  // namespace evpose
