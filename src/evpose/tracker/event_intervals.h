// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <span>
#include <vector>

#include "evpose/event/event_preprocessor.h"
#include "evpose/imu/strapdown.h"

namespace evpose {

/// Some events one after another, up to now_us, and how the body moved meanwhile.
struct EventInterval {
  std::vector<FilteredEvent> events;
  std::uint32_t now_us = 0;
  ImuIncrement motion;
  Eigen::Vector3d angular_rate = Eigen::Vector3d::Zero();  ///< rad/s, body, at now_us
};

/// The newest events in intervals so short that contours hardly turn in one.
class EventIntervals {
 public:
  static constexpr double kInterval_s = 0.008;
  /// Errors that an edge's events share count for more than the noise of so many: the rest is left out,
  /// evenly, and where lamps flicker evenly in time: these make events in bursts, what moves makes some
  /// always.
  static constexpr double kMostEvents_s = 1.25e6;

  /// Keeps the newest `most` intervals.
  explicit EventIntervals(std::size_t most) : most_(most) {}

  void clear() { intervals_.clear(); }
  /// Events up to `now_us`, how the body has moved since those before, and its present rate.
  void add(std::span<const FilteredEvent> events, std::uint32_t now_us, const ImuIncrement& motion,
           const Eigen::Vector3d& angular_rate);

  std::size_t size() const { return intervals_.size(); }
  /// The newest is number 0.
  const EventInterval& operator[](std::size_t age) const { return intervals_[intervals_.size() - 1 - age]; }
  double duration_s() const;

 private:
  std::size_t most_;
  std::deque<EventInterval> intervals_;  ///< the newest last
};

}  // namespace evpose
