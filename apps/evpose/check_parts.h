// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <vector>

#include "checklist.h"
#include "evpose/run/track_recording.h"

namespace evpose {

/// A recording with everything of it that more than one check needs.
struct CheckedRecording {
  Recording recording;
  std::vector<TimedPose> truth;  ///< empty: none, or it cannot be read
  std::vector<ImuSample> imu;    ///< empty: none
  std::shared_ptr<const Camera> camera;
};

void check_clocks(Checklist& list, const CheckedRecording& data);
void check_imu(Checklist& list, const CheckedRecording& data);
void check_calibration(Checklist& list, const CheckedRecording& data);
/// The map by itself. Null: it cannot be used.
std::shared_ptr<const ContourMap> check_map(Checklist& list, const TrackRequest& request,
                                            const Recording& recording);
/// Where the run starts, and what camera and map tell there and along the ground truth.
void check_start(Checklist& list, const TrackRequest& request, const CheckedRecording& data,
                 const ContourMap& map);

}  // namespace evpose
