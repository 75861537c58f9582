// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <vector>

#include "evpose/core/error.h"
#include "evpose/map_learn/joint_adjustment.h"
#include "evpose/map_learn/trajectory.h"
#include "evpose/run/track_recording.h"

namespace evpose::map_learn {

/// What a recording says of a map's contrast segments, seen from a known trajectory.
struct FlightObservations {
  std::vector<std::size_t> knots;         ///< states of the trajectory, evenly in time, the first 0
  std::vector<KnotStep> steps;            ///< what the IMU says between two of them
  std::vector<Observation> observations;  ///< `landmark` is the segment; in order of it, then of time
  std::vector<Eigen::Vector3d> views;     ///< of each observation: unit, from the contour to the camera
  std::vector<bool> silent;               ///< segments that were seen well enough, and told hardly any event
  ContourMap map;                         ///< with the contrast that the events have told
  double explained = 0;                   ///< share of the events that lie on contours
};

/// One pass over the events with the tracker's own registration: visibility, gate, edge delay and contrast
/// are as in flight. `job.map` is followed. `progress`: as of feed_recording(). Error: of the recording.
Expected<FlightObservations> observe_flight(const TrackJob& job, const Trajectory& trajectory,
                                            const std::function<bool(double)>& progress);

}  // namespace evpose::map_learn
