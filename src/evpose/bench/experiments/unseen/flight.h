// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "evpose/bench/experiments/unseen/draw.h"
#include "evpose/core/error.h"

namespace evpose::experiments::unseen {

/// A flight that was drawn and made: a recording with true contours and a map built from its cloud.
struct Flight {
  std::string folder;
  Draw draw;
  std::vector<std::string> refused;  ///< why the draws before could not be flown
  double duration_s = 0, mev_s = 0;  ///< events: million per second
  std::string map_fault;             ///< why no map could be built; empty: there is one

  std::string map_path() const { return folder + "/map.h5"; }
  std::string contours_path() const { return folder + "/contours.ply"; }
  std::string mesh_path() const { return folder + "/mesh.ply"; }
  std::string true_calibration_path() const { return folder + "/camchain-imucam_truth.yaml"; }
};

struct FlightRequest {
  std::string folder;
  int seed = 0;
  bool quick = false;
  bool rebuild_map = false;  ///< of a flight that is there
  int threads = 1;
};

/// The flight of a seed, taken from the folder if it is there. A draw that cannot be flown (the camera inside
/// of a wall, too fast, nothing to see) is followed by the next. Error: the folder cannot be written, or none
/// of many draws can be flown.
Expected<Flight> provide_flight(const FlightRequest& request);

}  // namespace evpose::experiments::unseen
