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

/// The way of events from the pixels to the outside.
struct ReadOutConfig {
  double max_rate_mev_s = 100;  ///< million events a second at most; 0: no limit, nothing late or lost
  int queue_events = 20000;     ///< that may wait; what comes on top is lost
};
void describe(ConfigTable& table, ReadOutConfig& config);

/// An arbiter that takes one event at a time. In a burst events wait in their rows; it goes from row to row,
/// downwards and round, and empties what stood in the row when it came. The stamp is the time of reading, in
/// whole microseconds, rounded down.
class ReadOut {
 public:
  ReadOut(ImageSize size, const ReadOutConfig& config);

  /// `events`: sorted by t, none after `until`, none before or at the `until` of the last call. Appends to
  /// `delivered`, in order of stamp, what is read up to then.
  void push(std::span<const SimEvent> events, TimeNs until, std::vector<SimEvent>& delivered);
  /// Reads what still waits.
  void finish(std::vector<SimEvent>& delivered);

  struct Counts {
    std::int64_t in = 0, delivered = 0, lost = 0;
    std::int64_t late = 0;  ///< delivered with another microsecond than that of their pixel
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
