// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <random>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/event/event.h"
#include "evpose/imu/imu.h"

namespace evpose::experiments {

enum class Fault {
  none,
  imu_gap,
  imu_saturated,
  imu_stuck,
  imu_jump_ahead,
  imu_jump_back,
  imu_not_a_number,
  imu_spike,
  events_drop_out,
  events_burst,
  events_packet_loss,
  events_stuck_rows
};
constexpr std::array<const char*, 12> kFaultNames{"none",
                                                  "IMU gap",
                                                  "IMU saturated",
                                                  "IMU axis stuck",
                                                  "IMU clock jumps ahead",
                                                  "IMU clock jumps back",
                                                  "IMU not a number",
                                                  "IMU spikes",
                                                  "event drop-out",
                                                  "event burst",
                                                  "event packet loss",
                                                  "event rows stuck"};

/// A fault from `from` to before `to`; a clock that jumps stays where it jumped to.
struct FaultWindow {
  Fault fault;
  TimeNs from, to;
};

/// Does to the samples what the fault does; a fault of the events leaves them alone.
void inject_imu_fault(const FaultWindow& window, std::mt19937& random, std::vector<ImuSample>* imu);

/// Does to the packets what the fault does; a fault of the IMU leaves them alone.
void inject_event_fault(const FaultWindow& window, ImageSize size, std::mt19937& random,
                        std::vector<EventPacket>* packets);

/// A number between the two.
double uniform_between(std::mt19937& random, double low, double high);

}  // namespace evpose::experiments
