// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/sensors/read_out.h"

#include <limits>

#include "evpose/core/config.h"
#include "evpose/core/error.h"
#include "evpose/sim/sensors/event_arbiter.h"

namespace evpose::sim {

void describe(ConfigTable& table, ReadOutConfig& c) {
  table.add("kind", c.kind,
            ConfigTable::Choices<ReadOutKind>{{"preset", ReadOutKind::preset},
                                              {"queue", ReadOutKind::queue},
                                              {"rows", ReadOutKind::rows},
                                              {"scan", ReadOutKind::scan}},
            "as of events.preset; one event, one row, or a frame at a time");
  table.add("max_rate_mev_s", c.max_rate_mev_s, "Mev/s", "rate limit; 0: none; -1: of events.preset",
            {-1, 1e4});
  table.add("queue_events", c.queue_events, "", "queue: its capacity; further events are lost",
            {1, 100000000});
  table.add("row_ns", c.row_ns, "ns", "rows: time per row besides that of its events", {0, 1e6});
  table.add("scan_hz", c.scan_hz, "Hz", "scan: highest rate of frames", {10, 1e5});
  table.add("scan_hold", c.scan_hold,
            "scan: all columns are sampled at the same moment, else one after the other");
  table.add("trail", c.trail,
            ConfigTable::Choices<TrailFilterKind>(kTrailFilters.begin(), kTrailFilters.end()),
            "trail filter: what is kept of a pixel's successive events of one polarity");
  table.add("trail_ms", c.trail_ms, "ms", "longest time between the events of a trail", {0.1, 1000});
  table.add("rate_control_mev_s", c.rate_control_mev_s, "Mev/s",
            "event rate controller: target in each 0.2 ms; 0: off", {0, 1e4});
}

ReadOut::ReadOut(ImageSize size, const ReadOutConfig& config, std::uint64_t seed)
    : arbiter_(make_arbiter(size, config)) {
  if (config.trail != TrailFilterKind::none)
    trail_.emplace(size, config.trail, from_seconds(1e-3 * config.trail_ms));
  if (config.rate_control_mev_s > 0) rate_.emplace(config.rate_control_mev_s, seed);
}

ReadOut::~ReadOut() = default;

void ReadOut::filter(TimeNs until, std::vector<SimEvent>& delivered) {
  const std::size_t before = delivered.size();
  for (SimEvent& event : read_) {
    event.t = whole_us(event.t);
    if (trail_ && !trail_->keeps(event)) {
      ++counts_.trailing;
    } else if (rate_) {
      rate_->add(event, delivered);
    } else {
      delivered.push_back(event);
    }
  }
  read_.clear();
  if (rate_) {
    rate_->flush(whole_us(until), delivered);
    counts_.shed = rate_->shed();
  }
  counts_.lost = arbiter_->lost();
  counts_.late = arbiter_->late();
  counts_.delivered += static_cast<std::int64_t>(delivered.size() - before);
}

void ReadOut::push(std::span<const SimEvent> events, TimeNs until, std::vector<SimEvent>& delivered) {
  counts_.in += static_cast<std::int64_t>(events.size());
  arbiter_->push(events, until, read_);
  filter(until, delivered);
}

void ReadOut::finish(std::vector<SimEvent>& delivered) {
  arbiter_->finish(read_);
  filter(std::numeric_limits<TimeNs>::max(), delivered);
}

}  // namespace evpose::sim
