// SPDX-License-Identifier: BSD-3-Clause
// What building a map in one run and in tiles share.
#pragma once

#include <string>
#include <vector>

#include "evpose/core/error.h"
#include "evpose/map/contour_map.h"

namespace evpose {

struct BuildRequest {
  std::string input, output;  ///< cloud, or folder of tiles; map, or folder of tiles to make
  std::string preset;         ///< "paper": the map of EV-Pose; empty: ours
  std::vector<std::string> assignments;
  std::vector<double> viewpoints;  ///< x, y, z of one after the other
  int threads = 1;
  int tile = 0;
  bool level = false;
};

/// Cuts the cloud into tiles and writes them to the folder `output`.
int plan_tiles(const BuildRequest& request);
/// Builds one tile of the folder `input`.
int build_tile_of(const BuildRequest& request);
/// Makes one map of the folder's tiles.
int merge_tiles(const BuildRequest& request);

/// Turns the map if it is to be levelled, writes it, and prints up, what can be told with it, and its name.
int finish_map(ContourMap map, const BuildRequest& request);

}  // namespace evpose
