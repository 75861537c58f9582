// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/serve/stream_queue.h"

#include <algorithm>
#include <chrono>

#include "evpose/core/config.h"

namespace evpose {
namespace {

constexpr std::size_t kMostImu = 200'000;           // samples: a minute and more of the fastest IMU
constexpr std::size_t kMostItems = 50'000;          // of any kind
constexpr int kMostStride = 30;                     // ten updates a second are left of 300
constexpr double kStride_ms = 10;                   // of waiting, for which an update more is left out
constexpr TimeNs kMoment = 10 * kNsPerMs;           // several updates, each of which makes packets wait
constexpr int kFewestPackets = 4;                   // of a moment
constexpr double kFaster = 1.1, kMostSlower = 0.5;  // steps of the share

TimeNs now_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

}  // namespace

void describe(ConfigTable& table, QueueConfig& c) {
  table.add("shed", c.shed, "leave out events under overload; false: the source waits, and nothing is lost");
  table.add("thin_after_ms", c.thin_after_ms, "ms",
            "if all events of a moment waited longer, less of the contours is looked at", {0.1, 1e5});
  table.add("drop_after_ms", c.drop_after_ms, "ms", "events that waited longer are left out", {0.1, 1e5});
  table.add("most_mev", c.most_mev, "", "million events waiting at most", {1, 1000});
}

/// Oldest first: what is newest counts.
void StreamQueue::make_room() {
  const std::size_t most = static_cast<std::size_t>(config_.most_mev) * 1'000'000;
  const auto too_many = [&](StreamItem::Kind kind) {
    return items_.size() > kMostItems ||
           (kind == StreamItem::Kind::events ? waiting_events_ > most : waiting_imu_ > kMostImu);
  };
  for (const auto kind : {StreamItem::Kind::events, StreamItem::Kind::imu})
    for (auto it = items_.begin(); it != items_.end() && too_many(kind);) {
      if (it->kind != kind) {
        ++it;
        continue;
      }
      waiting_events_ -= it->events.events.size(), waiting_imu_ -= it->imu.size();
      counts_.events_shed += it->events.events.size(), counts_.imu_shed += it->imu.size();
      it = items_.erase(it);
    }
}

bool StreamQueue::push(StreamItem item) {
  std::unique_lock lock(mutex_);
  item.arrived_ns = now_ns();
  if (!config_.shed) {
    const std::size_t room = static_cast<std::size_t>(config_.most_mev) * 1'000'000;
    emptied_.wait(lock, [&] {
      return closed_ || items_.empty() ||
             (waiting_events_ + item.events.events.size() <= room && items_.size() < kMostItems);
    });
  }
  if (closed_) return false;
  counts_.events_in += item.events.events.size(), counts_.imu_in += item.imu.size();
  waiting_events_ += item.events.events.size(), waiting_imu_ += item.imu.size();
  items_.push_back(std::move(item));
  if (config_.shed) make_room();
  counts_.most_waiting = std::max<std::uint64_t>(counts_.most_waiting, waiting_events_);
  filled_.notify_one();
  return true;
}

bool StreamQueue::pop(StreamItem& item, TimeNs timeout_ns) {
  std::unique_lock lock(mutex_);
  if (!filled_.wait_for(lock, std::chrono::nanoseconds(timeout_ns), [&] { return !items_.empty(); }))
    return false;
  item = std::move(items_.front());
  items_.pop_front();
  waiting_events_ -= item.events.events.size(), waiting_imu_ -= item.imu.size();
  emptied_.notify_one();
  if (config_.shed && item.kind == StreamItem::Kind::events) relieve(item, now_ns() - item.arrived_ns);
  return true;
}

double ShareByWait::add(TimeNs arrived_ns, double waited_ms) {
  least_ms_ = packets_ == 0 ? waited_ms : std::min(least_ms_, waited_ms);
  if (packets_++ == 0) moment_began_ = arrived_ns;
  if (packets_ < kFewestPackets || arrived_ns - moment_began_ < kMoment) return share_;
  share_ *= least_ms_ > late_ms_ ? std::max(kMostSlower, late_ms_ / least_ms_) : kFaster;
  share_ = std::clamp(share_, kLeast, 1.0);
  packets_ = 0;
  return share_;
}

void StreamQueue::relieve(StreamItem& item, TimeNs waited_ns) {
  const double waited_ms = 1e3 * to_seconds(waited_ns);
  item.share = share_.add(item.arrived_ns, waited_ms);
  if (item.share <= ShareByWait::kLeast)
    item.stride = std::min(kMostStride, 1 + static_cast<int>(waited_ms / kStride_ms));
  if (waited_ms <= config_.drop_after_ms) return;
  counts_.events_shed += item.events.events.size();
  item.events.events.clear();
}

void StreamQueue::close() {
  const std::lock_guard lock(mutex_);
  closed_ = true;
  emptied_.notify_all();
}

bool StreamQueue::closed() const {
  const std::lock_guard lock(mutex_);
  return closed_;
}

StreamQueue::Counts StreamQueue::counts() const {
  const std::lock_guard lock(mutex_);
  return counts_;
}

}  // namespace evpose
