// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "evpose/event/event.h"
#include "evpose/run/track_recording.h"

namespace evpose::experiments {

/// A recording in memory, to be tracked several times.
struct Streams {
  TrackJob job;
  std::vector<EventPacket> packets;
  std::vector<ImuSample> imu;
};
/// The calibration counts as known: that of the recordings is the truth, and what is wrong with it, an
/// experiment says.
Expected<Streams> load_streams(const TrackRequest& request, const RunConfig& config);

/// Feeds the packets and, ahead of each, the IMU samples that reach its end.
void feed(const std::vector<EventPacket>& packets, const std::vector<ImuSample>& imu, Tracker& tracker);

/// What lies between two times, with some IMU samples to both sides.
struct Excerpt {
  std::vector<EventPacket> packets;
  std::vector<ImuSample> imu;
};
Excerpt excerpt(const Streams& streams, TimeNs begin, TimeNs end);

/// Interpolated; at least two poses.
Pose true_pose(const std::vector<TimedPose>& truth, TimeNs t);

/// The pose, velocity and rate that the truth has at a time inside it.
StartState start_at(const std::vector<TimedPose>& truth, TimeNs t);

}  // namespace evpose::experiments
