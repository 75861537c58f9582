// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/sensors/event_arbiter.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <tuple>

#include "evpose/core/error.h"
#include "evpose/sim/sensors/read_out.h"

namespace evpose::sim {
namespace {

double event_time_ns(double max_rate_mev_s) { return max_rate_mev_s > 0 ? 1e3 / max_rate_mev_s : 0; }

std::size_t pixel_number(const SimEvent& event, std::size_t width) {
  return static_cast<std::size_t>(event.y) * width + event.x;
}

std::size_t area(ImageSize size) { return static_cast<std::size_t>(size.width) * size.height; }

// First whole nanosecond at or after.
TimeNs after(double ns) { return static_cast<TimeNs>(std::ceil(ns)); }

}  // namespace

TimeNs whole_us(TimeNs t) {
  const TimeNs rest = t % kNsPerUs;
  return t - rest - (rest < 0 ? kNsPerUs : 0);
}

void EventArbiter::deliver(SimEvent event, TimeNs t, std::vector<SimEvent>& read) {
  late_ += whole_us(t) != whole_us(event.t);
  event.t = t;
  read.push_back(event);
}

std::unique_ptr<EventArbiter> make_arbiter(ImageSize size, const ReadOutConfig& c) {
  EVPOSE_CHECK(size.height > 0 && c.kind != ReadOutKind::preset && c.max_rate_mev_s >= 0);
  if (c.kind == ReadOutKind::rows) return std::make_unique<RowArbiter>(size, c.max_rate_mev_s, c.row_ns);
  if (c.kind == ReadOutKind::scan)
    return std::make_unique<FrameScan>(size, c.max_rate_mev_s, c.scan_hz, c.scan_hold);
  return std::make_unique<EventQueue>(size, c.max_rate_mev_s, c.queue_events);
}

RowRequests::RowRequests(std::size_t rows) : rows_(rows), bits_((rows + kWord - 1) / kWord) {}

std::size_t RowRequests::next(std::size_t row) const {
  const std::size_t start = (row + 1) % rows_;
  for (std::size_t i = 0; i <= bits_.size(); ++i) {  // the first word twice: from `start`, and up to it
    const std::size_t word = (start / kWord + i) % bits_.size();
    std::uint64_t bits = bits_[word];
    if (i == 0) bits &= ~std::uint64_t{0} << (start % kWord);
    if (bits != 0) return word * kWord + static_cast<std::size_t>(std::countr_zero(bits));
  }
  EVPOSE_CHECK(false);
}

EventQueue::EventQueue(ImageSize size, double max_rate_mev_s, int capacity)
    : slot_ns_(event_time_ns(max_rate_mev_s)),
      capacity_(static_cast<std::size_t>(capacity)),
      rows_(static_cast<std::size_t>(size.height)),
      requests_(rows_.size()) {
  EVPOSE_CHECK(capacity > 0);
}

TimeNs EventQueue::next_slot() const {
  return burst_start_ + static_cast<TimeNs>(slot_ns_ * static_cast<double>(slots_used_));
}

void EventQueue::add(const SimEvent& event) {
  if (waiting_ >= capacity_) {
    ++lost_;
    return;
  }
  if (waiting_ == 0 && event.t >= next_slot()) burst_start_ = event.t, slots_used_ = 0;
  rows_[event.y].waiting.push_back(event);
  requests_.set(event.y);
  ++waiting_;
}

void EventQueue::read_one(std::vector<SimEvent>& read) {
  if (left_in_row_ == 0) {
    row_ = requests_.next(row_);
    left_in_row_ = rows_[row_].waiting.size() - rows_[row_].read;
  }
  Row& row = rows_[row_];
  deliver(row.waiting[row.read++], next_slot(), read);
  ++slots_used_;
  --waiting_;
  --left_in_row_;
  if (row.read == row.waiting.size()) {
    row.waiting.clear();
    row.read = 0;
    requests_.clear(row_);
  }
}

void EventQueue::push(std::span<const SimEvent> events, TimeNs until, std::vector<SimEvent>& read) {
  for (const SimEvent& event : events) {
    if (slot_ns_ == 0) {
      deliver(event, event.t, read);
      continue;
    }
    while (waiting_ > 0 && next_slot() < event.t) read_one(read);
    add(event);
  }
  while (waiting_ > 0 && next_slot() <= until) read_one(read);
}

void EventQueue::finish(std::vector<SimEvent>& read) {
  while (waiting_ > 0) read_one(read);
}

RowArbiter::RowArbiter(ImageSize size, double max_rate_mev_s, double row_ns)
    : width_(static_cast<std::size_t>(size.width)),
      row_ns_(row_ns),
      word_ns_(kWordPixels * event_time_ns(max_rate_mev_s)),
      rows_(static_cast<std::size_t>(size.height)),
      waits_(area(size)),
      requests_(rows_.size()) {}

void RowArbiter::add(const SimEvent& event) {
  auto waits = waits_[pixel_number(event, width_)];
  if (waits) {
    ++lost_;
    return;
  }
  waits = true;
  if (waiting_++ == 0) next_ns_ = std::max(next_ns_, static_cast<double>(event.t));
  rows_[event.y].push_back(event);
  requests_.set(event.y);
}

void RowArbiter::read_row(std::vector<SimEvent>& read) {
  row_ = requests_.next(row_);
  std::vector<SimEvent>& events = rows_[row_];
  std::sort(events.begin(), events.end(), [](const SimEvent& a, const SimEvent& b) { return a.x < b.x; });
  int words = 0, last = -1;
  for (const SimEvent& event : events) {
    words += event.x / kWordPixels != last;
    last = event.x / kWordPixels;
    waits_[pixel_number(event, width_)] = false;
    deliver(event, after(next_ns_), read);
  }
  waiting_ -= events.size();
  events.clear();
  requests_.clear(row_);
  next_ns_ += row_ns_ + words * word_ns_;
}

void RowArbiter::push(std::span<const SimEvent> events, TimeNs until, std::vector<SimEvent>& read) {
  for (const SimEvent& event : events) {
    while (waiting_ > 0 && after(next_ns_) < event.t) read_row(read);
    add(event);
  }
  while (waiting_ > 0 && after(next_ns_) <= until) read_row(read);
}

void RowArbiter::finish(std::vector<SimEvent>& read) {
  while (waiting_ > 0) read_row(read);
}

FrameScan::FrameScan(ImageSize size, double max_rate_mev_s, double scan_hz, bool hold)
    : width_(static_cast<std::size_t>(size.width)),
      event_ns_(event_time_ns(max_rate_mev_s)),
      step_ns_(1e9 / scan_hz / (hold ? 1 : size.width)),
      groups_(hold ? 1 : width_),
      waits_(area(size)),
      next_ns_(step_ns_) {}

void FrameScan::sample(std::vector<SimEvent>& read) {
  std::vector<SimEvent>& events = groups_[group_];
  std::sort(events.begin(), events.end(),
            [](const SimEvent& a, const SimEvent& b) { return std::tie(a.x, a.y) < std::tie(b.x, b.y); });
  for (const SimEvent& event : events) {
    waits_[pixel_number(event, width_)] = false;
    deliver(event, after(next_ns_), read);
  }
  next_ns_ += std::max(step_ns_, event_ns_ * static_cast<double>(events.size()));
  waiting_ -= events.size();
  events.clear();
  group_ = (group_ + 1) % groups_.size();
}

void FrameScan::push(std::span<const SimEvent> events, TimeNs until, std::vector<SimEvent>& read) {
  for (const SimEvent& event : events) {
    while (after(next_ns_) < event.t) sample(read);
    auto waits = waits_[pixel_number(event, width_)];
    if (waits) {
      ++lost_;
      continue;
    }
    waits = true;
    ++waiting_;
    groups_[event.x % groups_.size()].push_back(event);
  }
  while (after(next_ns_) <= until) sample(read);
}

void FrameScan::finish(std::vector<SimEvent>& read) {
  while (waiting_ > 0) sample(read);
}

}  // namespace evpose::sim
