// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/sim/sensors/sim_event.h"

namespace evpose {
class ConfigTable;
}

namespace evpose::sim {

/// Read-out of the events from the pixel array.
struct ReadOutConfig {
  double max_rate_mev_s = 100;  ///< limit, million events per second; 0: unlimited, nothing delayed or lost
  int queue_events = 20000;     ///< capacity of the queue; further events are lost
};
void describe(ConfigTable& table, ReadOutConfig& config);

/// A row arbiter that reads one event at a time. In a burst events queue in their rows. The arbiter visits
/// the rows cyclically downwards and reads the events that are queued in a row at its arrival. The timestamp
/// is the time of reading, rounded down to whole microseconds.
class ReadOut {
 public:
  ReadOut(ImageSize size, const ReadOutConfig& config);

  /// `events`: sorted by t, none after `until`, none before or at the `until` of the last call. Appends to
  /// `delivered`, in order of timestamp, the events that are read until then.
  void push(std::span<const SimEvent> events, TimeNs until, std::vector<SimEvent>& delivered);
  /// Reads the rest of the queue.
  void finish(std::vector<SimEvent>& delivered);

  struct Counts {
    std::int64_t in = 0, delivered = 0, lost = 0;
    std::int64_t late = 0;  ///< events delivered with a later microsecond than that of their pixel
  };
  const Counts& counts() const { return counts_; }

 private:
  struct Row {
    std::vector<SimEvent> waiting;
    std::size_t read = 0;  ///< of these
  };
  TimeNs next_slot() const;
  void add(const SimEvent& event);
  void read_one(std::vector<SimEvent>& delivered);
  void deliver(SimEvent event, TimeNs t, std::vector<SimEvent>& delivered);
  std::size_t next_row() const;

  double slot_ns_ = 0;  ///< time per event; 0: no limit
  std::size_t queue_;
  std::vector<Row> rows_;
  std::vector<std::uint64_t> filled_;  ///< one bit per row where events wait
  std::size_t waiting_ = 0, row_ = 0, left_in_row_ = 0;
  TimeNs burst_start_ = 0;
  std::int64_t slots_used_ = 0;  ///< since then
  Counts counts_;
};

}  // namespace evpose::sim
