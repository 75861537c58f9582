// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <vector>

#include "evpose/imu/imu.h"
#include "evpose/io/recording/event_survey.h"

namespace evpose {

/// A shift of the events' clock by which events come fast where the IMU turns fast.
struct ClockOffset {
  double offset_s = 0;     ///< to be added to the times of the events
  double correlation = 0;  ///< of the rates of events and of turning, at this shift
  double as_read = 0;      ///< the same without a shift; 0 where they have too little time in common
};

/// The shift of the greatest correlation over at least 3 s and two thirds of the shorter stream, good to
/// about 10 ms. nullopt where the motion does not tell it: no turning, steady or periodic turning.
std::optional<ClockOffset> find_clock_offset(const EventSummary& events, const std::vector<ImuSample>& imu);

}  // namespace evpose
