// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "evpose/bench/experiments/unseen/flight.h"
#include "evpose/bench/experiments/unseen/result.h"
#include "evpose/core/pose.h"
#include "evpose/io/files/png_file.h"
#include "evpose/run/track_recording.h"

namespace evpose::experiments::unseen {

/// The square of the error in sigmas (Mahalanobis, six degrees of freedom) that chi-square exceeds as rarely
/// as a normal variable exceeds 5 sigma: 5.7e-7.
inline constexpr double kFarSquared = 39.493;
inline constexpr double kJudgedAfter_s = 0.3;

/// What is remembered of an update.
struct TrackedPose {
  TimedPose pose;  ///< T_map_body
  Matrix6d covariance;
  Health health;
};

/// Errors over the time of the flight, a value for each of some hundred moments.
struct ErrorCourse {
  std::vector<double> t_s, position_mm, rotation_deg;
  std::vector<double> sigma_mm;  ///< of the position, as stated
  std::vector<bool> tracking;    ///< called so
};
struct Judgement {
  RunFigures figures;
  ErrorCourse course;
};
/// The poses from `from` on against the truth. Those that the tracker calls lost (or waiting) are no poses
/// that it stands by: they count for the share of `tracking` only.
Judgement judge(const std::vector<TrackedPose>& poses, const std::vector<TimedPose>& truth, TimeNs from);

struct TrackedRun {
  Judgement judgement;
  std::optional<RgbImage> picture;  ///< of the moment with the largest error: events and contours
};

/// Tracks the flight from the true start. Error: the flight cannot be read. A map or a start that the tracker
/// refuses is a fault in the figures.
Expected<TrackedRun> track_flight(const Flight& flight, Given given, const RunConfig& config);

}  // namespace evpose::experiments::unseen
