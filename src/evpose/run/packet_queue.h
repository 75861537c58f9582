// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <condition_variable>
#include <deque>
#include <mutex>
#include <optional>
#include <thread>

#include "evpose/core/error.h"
#include "evpose/io/events/event_reader.h"

namespace evpose {

/// Reads packets ahead on a thread of its own, at most `kAhead` of them. What comes out, and in which order,
/// is what the reader alone would give.
class PacketQueue {
 public:
  explicit PacketQueue(EventReader& reader) : reader_(reader), thread_([this] { run(); }) {}
  ~PacketQueue();
  PacketQueue(const PacketQueue&) = delete;
  PacketQueue& operator=(const PacketQueue&) = delete;

  /// As EventReader::next.
  Expected<bool> next(EventPacket& packet);

 private:
  static constexpr std::size_t kAhead = 32;
  void run();

  EventReader& reader_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<EventPacket> packets_, spare_;
  std::optional<Error> error_;
  bool ended_ = false, stop_ = false;
  std::thread thread_;  // last: it uses all of the above
};

}  // namespace evpose
