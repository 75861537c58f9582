// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "evpose/core/error.h"
#include "evpose/sim/recording/scenario.h"

namespace evpose::experiments::unseen {

/// What a seed has drawn: a place, its light, a flight, sensors, and the faults of what is handed over.
struct Draw {
  std::vector<std::string> settings;  ///< of `evpose simulate` on top of its defaults, "key=value"
  std::string scene, light, motion, camera, sensors, map, calibration;  ///< the same in words

  /// Of the settings: draws with equal keys are equal.
  std::string key() const;
};

/// The draw of a seed; the attempts of one seed have nothing in common. Depends on its arguments alone.
/// `quick`: 320x240, 1 s and a small cloud.
Draw draw_flight(int seed, int attempt, bool quick);

/// The scenario of a draw. Error: a setting that the simulator does not know.
Expected<sim::Scenario> scenario_of(const Draw& draw);

}  // namespace evpose::experiments::unseen
