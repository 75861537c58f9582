// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/sensors/read_out.h"

#include <bit>
#include <limits>

#include "evpose/core/config.h"
#include "evpose/core/error.h"

namespace evpose::sim {
namespace {

constexpr std::size_t kWord = 64;

TimeNs whole_us(TimeNs t) {
  const TimeNs rest = t % kNsPerUs;
  return t - rest - (rest < 0 ? kNsPerUs : 0);
}

}  // namespace

void describe(ConfigTable& table, ReadOutConfig& c) {
  table.add("max_rate_mev_s", c.max_rate_mev_s, "Mev/s", "rate limit of the read-out; 0: none", {0, 1e4});
  table.add("queue_events", c.queue_events, "", "capacity of the read-out queue; further events are lost",
            {1, 100000000});
}

ReadOut::ReadOut(ImageSize size, const ReadOutConfig& config)
    : slot_ns_(config.max_rate_mev_s > 0 ? 1e3 / config.max_rate_mev_s : 0),
      queue_(static_cast<std::size_t>(config.queue_events)),
      rows_(static_cast<std::size_t>(size.height)),
      filled_((rows_.size() + kWord - 1) / kWord) {
  EVPOSE_CHECK(size.height > 0 && config.queue_events > 0);
}

void ReadOut::deliver(SimEvent event, TimeNs t, std::vector<SimEvent>& delivered) {
  const TimeNs stamp = whole_us(t);
  counts_.late += stamp != whole_us(event.t);
  ++counts_.delivered;
  event.t = stamp;
  delivered.push_back(event);
}

TimeNs ReadOut::next_slot() const {
  return burst_start_ + static_cast<TimeNs>(slot_ns_ * static_cast<double>(slots_used_));
}

void ReadOut::add(const SimEvent& event) {
  if (waiting_ >= queue_) {
    ++counts_.lost;
    return;
  }
  if (waiting_ == 0 && event.t >= next_slot()) burst_start_ = event.t, slots_used_ = 0;
  rows_[event.y].waiting.push_back(event);
  filled_[event.y / kWord] |= std::uint64_t{1} << (event.y % kWord);
  ++waiting_;
}

std::size_t ReadOut::next_row() const {
  const std::size_t start = (row_ + 1) % rows_.size();
  for (std::size_t i = 0; i <= filled_.size(); ++i) {  // the first word twice: from `start`, and up to it
    const std::size_t word = (start / kWord + i) % filled_.size();
    std::uint64_t bits = filled_[word];
    if (i == 0) bits &= ~std::uint64_t{0} << (start % kWord);
    if (bits != 0) return word * kWord + static_cast<std::size_t>(std::countr_zero(bits));
  }
  EVPOSE_CHECK(false);
}

void ReadOut::read_one(std::vector<SimEvent>& delivered) {
  if (left_in_row_ == 0) {
    row_ = next_row();
    left_in_row_ = rows_[row_].waiting.size() - rows_[row_].read;
  }
  Row& row = rows_[row_];
  deliver(row.waiting[row.read++], next_slot(), delivered);
  ++slots_used_;
  --waiting_;
  --left_in_row_;
  if (row.read == row.waiting.size()) {
    row.waiting.clear();
    row.read = 0;
    filled_[row_ / kWord] &= ~(std::uint64_t{1} << (row_ % kWord));
  }
}

void ReadOut::push(std::span<const SimEvent> events, TimeNs until, std::vector<SimEvent>& delivered) {
  for (const SimEvent& event : events) {
    EVPOSE_CHECK(event.y < rows_.size());
    ++counts_.in;
    if (slot_ns_ == 0) {
      deliver(event, event.t, delivered);
      continue;
    }
    while (waiting_ > 0 && next_slot() < event.t) read_one(delivered);
    add(event);
  }
  while (waiting_ > 0 && next_slot() <= until) read_one(delivered);
}

void ReadOut::finish(std::vector<SimEvent>& delivered) {
  while (waiting_ > 0) read_one(delivered);
}

}  // namespace evpose::sim
