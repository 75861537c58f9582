// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "evpose/core/error.h"
#include "evpose/io/maps/map_h5.h"
#include "evpose/io/recording/recording.h"
#include "evpose/tracker/tracker.h"

namespace evpose {

/// How far off a pose given by hand may be, 1 sigma per axis; 0: as configured.
struct StartSigma {
  double position_m = 0, rotation_deg = 0;
};

/// Where a run starts, from the words of --init:
///   auto         ground truth if the recording has it, else its initial_pose
///   groundtruth  the first ground-truth pose inside the events, with its velocity
///   x,y,z,qx,qy,qz,qw[@t_s]   T_map_body at a time of the recording's clock, at rest or moving slowly
///   FILE         a TUM trajectory of T_map_body, used like ground truth
///   gps:LAT,LON,ALT[,SIGMA]   T_map_body's place within SIGMA m (kGpsSigma_m), where the map is placed on
///   the earth; degrees and m above the ellipsoid. At the recording's begin, with any heading anywhere     at
///   the recording's begin, at the origin: nothing is known (StartState is to be put into the map)
/// A pose without velocity widens the start's uncertainty in `config`.
Expected<StartState> choose_start(const std::string& init, const Recording& recording,
                                  const std::vector<TimedPose>& truth, const StartSigma& sigma,
                                  const MapPlacement& placement, FusionConfig* config);

/// The start's sigma where nothing is known: positions further off than the map reaches do not matter.
inline constexpr double kAnywhereSigma_m = 1e3, kAnyHeading_deg = 180, kGpsSigma_m = 3;
inline bool starts_anywhere(const std::string& init) { return init == "anywhere"; }
inline bool starts_by_gps(const std::string& init) { return init.starts_with("gps:"); }

/// Where choose_start() takes the pose from, in words: "started from ground truth".
std::string start_words(const std::string& init, bool has_truth);

}  // namespace evpose
