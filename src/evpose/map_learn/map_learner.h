// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "evpose/core/error.h"
#include "evpose/map_learn/learning_map.h"
#include "evpose/map_learn/trajectory.h"
#include "evpose/run/track_recording.h"

namespace evpose::map_learn {

/// What one flight has told.
struct FlightReport {
  std::string recording;
  double seconds = 0;
  double tracked = 0;  ///< share of the updates, by the filter, with the map before
  double explained_before = 0, explained_after = 0;  ///< share of the events that lie on contours
  LearntLengths lengths;
  double view_spread_deg = 0;  ///< typical angle between the directions from which a contour was seen
  double delay_px = 0;         ///< of all events, beside the edge delay
  /// How well the cloud's contours tie all that was learnt, together, to the cloud's frame.
  Eigen::Vector3d common_sigma_m = Eigen::Vector3d::Zero();   ///< weakest first
  Eigen::Matrix3d common_axes = Eigen::Matrix3d::Identity();  ///< columns, of these
  double common_rotation_sigma_rad = 0;
};

/// What is learnt from.
struct Flight {
  TrackRequest request;
  std::string run;  ///< folder of a run that was tracked of it with the request's map; empty: to be tracked
};

/// What a pass over a flight is told, 0..1; false ends it.
using LearnProgress = std::function<bool(double)>;

/// A map made better by one flight.
struct LearntMap {
  ContourMap map;
  FlightReport report;
  Trajectory trajectory;  ///< of the flight, as adjusted
};

/// Smooths the recording of the flight with `map` in place of the request's, finds markings on its planes and
/// edges off them, and adjusts trajectory, contours and what was found together. Interrupted: an empty map.
/// Errors: of the recording; a run of something else; a flight that was lost, or that tells nothing.
Expected<LearntMap> learn_from_flight(const Flight& flight, const ContourMap& map,
                                      const LearnProgress& progress);

}  // namespace evpose::map_learn
