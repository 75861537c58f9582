// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "evpose/bench/experiments/recordings.h"

namespace evpose::experiments {

struct EdgeDelaysRequest {
  std::vector<std::string> recordings;  ///< folders, all of one sensor
  std::vector<std::string> maps;        ///< one for each or one for all; none: contours.ply of each
  std::vector<std::string>
      occluders;         ///< likewise; none: mesh.ply beside the contours.ply, where no map is given
  bool tracked = false;  ///< from the poses that the tracker finds, not from the true ones
  std::vector<std::string> assignments;  ///< settings of the tracker
};

/// Fits the sensor's parameters of the edge delay to the places of events beside contours, and tells what
/// each fit leaves over: of each recording with its own fit, and with that of the others.
Status print_edge_delays(const EdgeDelaysRequest& request);

}  // namespace evpose::experiments
