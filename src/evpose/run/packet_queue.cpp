// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/run/packet_queue.h"

#include <utility>

namespace evpose {

PacketQueue::~PacketQueue() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void PacketQueue::run() {
  EventPacket packet;
  while (true) {
    const auto more = reader_.next(packet);
    std::unique_lock lock(mutex_);
    if (!more || !*more) {
      if (!more) error_ = more.error();
      ended_ = true;
      changed_.notify_all();
      return;
    }
    changed_.wait(lock, [this] { return stop_ || packets_.size() < kAhead; });
    if (stop_) return;
    packets_.push_back(std::move(packet));
    packet = {};
    if (!spare_.empty()) {
      packet = std::move(spare_.front());
      spare_.pop_front();
    }
    changed_.notify_all();
  }
}

Expected<bool> PacketQueue::next(EventPacket& packet) {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return ended_ || !packets_.empty(); });
  if (packets_.empty()) {
    packet.events.clear();
    if (error_) return *error_;
    return false;
  }
  spare_.push_back(std::exchange(packet, std::move(packets_.front())));
  packets_.pop_front();
  changed_.notify_all();
  return true;
}

}  // namespace evpose
