// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/input_queue.h"

#include <algorithm>
#include <utility>

namespace evpose {

void InputQueue::offer(const EventPacket& packet) {
  EVPOSE_CHECK(offered_ == nullptr);
  if (packet.events.empty()) return;
  offered_ = &packet;
  offered_from_ = 0;
}

void InputQueue::keep_rest() {
  if (offered_ == nullptr) return;
  const auto rest = offered_->events.begin() + static_cast<std::ptrdiff_t>(offered_from_);
  waiting_.push_back({offered_->base, {rest, offered_->events.end()}});
  offered_ = nullptr;
}

std::size_t InputQueue::feed(const EventPacket& packet, std::size_t from, TimeNs t) {
  const auto begin = packet.events.begin() + static_cast<std::ptrdiff_t>(from);
  const auto end = std::upper_bound(begin, packet.events.end(), t,
                                    [&](TimeNs until, const Event& e) { return until < packet.time(e); });
  const double started_s = clock_ ? clock_() : 0;
  filter_.take(packet, {begin, end});
  if (clock_) feeding_s_ += clock_() - started_s;
  return static_cast<std::size_t>(end - packet.events.begin());
}

bool InputQueue::feed_until(TimeNs t) {
  for (; !waiting_.empty(); waiting_.pop_front(), waiting_from_ = 0) {
    waiting_from_ = feed(waiting_.front(), waiting_from_, t);
    if (waiting_from_ < waiting_.front().events.size()) return true;
  }
  if (offered_ == nullptr) return false;
  offered_from_ = feed(*offered_, offered_from_, t);
  if (offered_from_ < offered_->events.size()) return true;
  offered_ = nullptr;
  return false;
}

TimeNs InputQueue::newest() const {
  const EventPacket& last = offered_ != nullptr ? *offered_ : waiting_.back();
  return last.time(last.events.back());
}

double InputQueue::take_feeding_time_s() { return std::exchange(feeding_s_, 0); }

}  // namespace evpose
