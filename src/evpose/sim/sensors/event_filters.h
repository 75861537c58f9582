// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/camera/trail_filter.h"
#include "evpose/sim/sensors/sim_event.h"

namespace evpose::sim {

/// Trail filter on the sensor: drops by the place of an event in its trail.
class TrailFilter {
 public:
  TrailFilter(ImageSize size, TrailFilterKind kind, TimeNs longest_gap);
  /// Of the events in order of time.
  bool keeps(const SimEvent& event);

 private:
  struct Pixel {
    TimeNs last = 0;
    bool on = false;
    std::uint8_t place = 0;  ///< in the trail: none, first, second, later
  };
  std::size_t width_;
  TrailFilterKind kind_;
  TimeNs longest_gap_;
  std::vector<Pixel> pixels_;
};

/// Event rate controller: of the events of a period of 200 us those beyond the target are dropped, evenly at
/// random.
class RateController {
 public:
  static constexpr TimeNs kPeriod = 200 * kNsPerUs;
  RateController(double target_mev_s, std::uint64_t seed);
  /// In order of time.
  void add(const SimEvent& event, std::vector<SimEvent>& kept);
  /// No event before `until` follows.
  void flush(TimeNs until, std::vector<SimEvent>& kept);
  std::int64_t shed() const { return shed_; }

 private:
  void release(std::vector<SimEvent>& kept);

  std::size_t most_;
  std::uint64_t seed_;
  std::int64_t period_ = 0, shed_ = 0;
  std::vector<SimEvent> held_;  ///< of the period
};

}  // namespace evpose::sim
