// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/sim/sensors/event_filters.h"
#include "evpose/sim/sensors/sim_event.h"

namespace evpose {
class ConfigTable;
}

namespace evpose::sim {

class EventArbiter;

enum class ReadOutKind : std::uint8_t {
  preset,  ///< as of the sensor
  queue,   ///< one event at a time (EventQueue)
  rows,    ///< all events of a row at once (RowArbiter)
  scan,    ///< in frames (FrameScan)
};

/// Read-out of the events from the pixel array, and the filters on the sensor behind it.
struct ReadOutConfig {
  ReadOutKind kind = ReadOutKind::preset;
  double max_rate_mev_s = -1;  ///< limit, million events per second; 0: none; negative: the preset's
  int queue_events = 20000;    ///< queue: its capacity; further events are lost
  double row_ns = 40;          ///< rows: time per row besides that of its events
  double scan_hz = 5000;       ///< scan: highest rate of frames
  bool scan_hold = true;       ///< scan: all columns are sampled at the same moment, else one after the other
  TrailFilterKind trail = TrailFilterKind::none;
  double trail_ms = 10;           ///< longest time between the events of a trail
  double rate_control_mev_s = 0;  ///< event rate controller: target; 0: off
};
void describe(ConfigTable& table, ReadOutConfig& config);

/// Arbiter, trail filter and rate controller, in this order. Timestamps are whole microseconds, rounded down.
class ReadOut {
 public:
  /// `config`: with the values of a preset. `seed`: of the rate controller's choice.
  ReadOut(ImageSize size, const ReadOutConfig& config, std::uint64_t seed);
  ~ReadOut();

  /// `events`: sorted by t, none after `until`, none before or at the `until` of the last call. Appends to
  /// `delivered`, in order of timestamp, the events that leave the sensor until then.
  void push(std::span<const SimEvent> events, TimeNs until, std::vector<SimEvent>& delivered);
  /// Reads the rest.
  void finish(std::vector<SimEvent>& delivered);

  /// in = delivered + lost + trailing + shed once all is read.
  struct Counts {
    std::int64_t in = 0, delivered = 0;
    std::int64_t lost = 0;  ///< for want of a place in the queue, or because the pixel's last event waited
    std::int64_t trailing = 0;  ///< dropped by the trail filter
    std::int64_t shed = 0;      ///< dropped by the rate controller
    std::int64_t late = 0;      ///< read in a later microsecond than that of the pixel's event
  };
  const Counts& counts() const { return counts_; }

 private:
  /// What the arbiter has read passes the filters; nothing earlier than `until` follows.
  void filter(TimeNs until, std::vector<SimEvent>& delivered);

  std::unique_ptr<EventArbiter> arbiter_;
  std::optional<TrailFilter> trail_;
  std::optional<RateController> rate_;
  std::vector<SimEvent> read_;
  Counts counts_;
};

}  // namespace evpose::sim
