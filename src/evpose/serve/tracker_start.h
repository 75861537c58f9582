// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>

#include "evpose/core/error.h"
#include "evpose/tracker/tracker.h"

namespace evpose {

/// How well GPS and a compass know a pose, 1 sigma per axis.
inline constexpr double kByGps_m = 3, kByCompass_rad = 0.35;

/// Where a tracker of a live stream begins, and how well that is known.
struct TrackerStart {
  StartState state;
  /// 1 sigma per axis, if that is more than configured.
  double position_sigma_m = 0, rotation_sigma_rad = 0, velocity_sigma_m_s = 0;
  bool searches = false;  ///< it searches for its pose, however long that takes, instead of going on without
};

/// `setup` and `config` are those of the stream's first start; of a map that is held in parts, the one around
/// the start is taken. Errors as Tracker::create().
Expected<std::unique_ptr<Tracker>> make_tracker(const TrackerSetup& setup, const TrackerConfig& config,
                                                const TrackerStart& start, const StageClock& clock = {});

}  // namespace evpose
