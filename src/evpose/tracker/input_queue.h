// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <deque>
#include <functional>

#include "evpose/core/error.h"
#include "evpose/event/event_preprocessor.h"

namespace evpose {

/// Seconds on any monotone clock; for the times of stages alone, nothing in the estimate depends on it.
using StageClock = std::function<double()>;

/// Event packets on their way to the noise filter: hands on what belongs before an update, holds back the
/// rest.
class InputQueue {
 public:
  InputQueue(EventPreprocessor& filter, StageClock clock) : filter_(filter), clock_(std::move(clock)) {}

  /// Puts a packet at the end of the queue. It is borrowed until keep_rest().
  void offer(const EventPacket& packet);
  /// Copies what has not been fed of the packet offered.
  void keep_rest();

  /// Feeds events up to t to the noise filter. True if a later event proves that all of them were here.
  bool feed_until(TimeNs t);
  /// Of the newest event in the queue; the queue is not empty.
  TimeNs newest() const;
  bool empty() const { return waiting_.empty() && offered_ == nullptr; }

  /// Time that feeding has taken since the last call of this.
  double take_feeding_time_s();

 private:
  /// Feeds the part of one packet from `from` on that is not after t; returns where the rest begins.
  std::size_t feed(const EventPacket& packet, std::size_t from, TimeNs t);

  EventPreprocessor& filter_;
  StageClock clock_;
  std::deque<EventPacket> waiting_;
  std::size_t waiting_from_ = 0;  ///< the part of the first that has been fed
  const EventPacket* offered_ = nullptr;
  std::size_t offered_from_ = 0;
  double feeding_s_ = 0;
};

}  // namespace evpose
