// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/serve/recovery.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "evpose/core/log.h"

namespace evpose {
namespace {

constexpr TimeNs kCaughtUp = 20 * kNsPerMs;  // the rest is tracked when the tracker is taken
// While it catches up: of the contours, and of the updates.
constexpr double kShareBehind = 0.1;
constexpr int kStrideBehind = 3;
constexpr int kNice = 10;                 // the poses that are sent come first
constexpr TimeNs kBurst = 20 * kNsPerMs;  // so much of the share may come at once

}  // namespace

EventPacket EvenShare::of(const EventPacket& packet) {
  const TimeNs newest = packet.time(packet.events.back());
  const TimeNs passed = newest_ == 0 ? kBurst : std::clamp<TimeNs>(newest - newest_, 0, kBurst);
  newest_ = newest;
  const double per_ns = 1e6 * most_mev_s_ / static_cast<double>(kNsPerS);
  allowed_ = std::min(per_ns * static_cast<double>(kBurst), allowed_ + per_ns * static_cast<double>(passed));
  const auto count = static_cast<double>(packet.events.size());
  const auto step = static_cast<std::size_t>(std::ceil(count / std::max(allowed_, 1.0)));
  EventPacket out;
  out.base = packet.base;
  out.events.reserve(packet.events.size() / step + 1);
  for (std::size_t i = 0; i < packet.events.size(); i += step) out.events.push_back(packet.events[i]);
  allowed_ -= static_cast<double>(out.events.size());
  return out;
}

Recovery::Recovery(Make make, bool waits)
    : waits_(waits), thread_([this, make = std::move(make)] { run(make); }) {
  std::unique_lock lock(mutex_);
  if (waits_) emptied_.wait(lock, [this] { return made_ || failed_; });
}

Recovery::~Recovery() {
  give_up();
  if (thread_.joinable()) thread_.join();
}

void Recovery::give_up() {
  const std::lock_guard lock(mutex_);
  stopped_ = true;
  filled_.notify_all();
  emptied_.notify_all();
}

TimeNs Recovery::reached() const {
  const std::lock_guard lock(mutex_);
  return last_ ? last_->t : std::numeric_limits<TimeNs>::min() / 2;
}

bool Recovery::tracks() const {
  const std::lock_guard lock(mutex_);
  return last_ && last_->health == Health::tracking;
}

std::string Recovery::take_ambiguous() {
  const std::lock_guard lock(mutex_);
  return std::exchange(ambiguous_, {});
}

bool Recovery::needs_search() const {
  const std::lock_guard lock(mutex_);
  return needs_search_;
}

bool Recovery::failed() const {
  const std::lock_guard lock(mutex_);
  return failed_;
}

bool Recovery::ended() const {
  const std::lock_guard lock(mutex_);
  return ended_;
}

void Recovery::push(std::unique_lock<std::mutex>& lock, Item item) {
  items_.push_back(std::move(item));
  filled_.notify_one();
  if (waits_) emptied_.wait(lock, [this] { return (items_.empty() && !busy_) || ended_; });
}

void Recovery::add_imu(const ImuSample& sample) {
  std::unique_lock lock(mutex_);
  push(lock, sample);
}

void Recovery::add_events(const EventPacket& packet) {
  std::unique_lock lock(mutex_);
  if (packet.empty() || !made_) return;
  EventPacket share = share_.of(packet);
  waiting_ += share.events.size();
  failed_ |= waiting_ > kMostWaiting;
  if (!failed_) push(lock, std::move(share));
}

void Recovery::feed(const Item& item, TimeNs newest) {
  if (const auto* sample = std::get_if<ImuSample>(&item)) return tracker_->add_imu(*sample);
  const EventPacket& packet = std::get<EventPacket>(item);
  const bool hurries = packet.time(packet.events.back()) < newest - kCaughtUp && !tracker_->searching();
  tracker_->limit_event_share(hurries ? kShareBehind : 1);
  tracker_->set_update_stride(hurries ? kStrideBehind : 1);
  tracker_->add_events(packet);
}

void Recovery::run(const Make& make) {
  ::setpriority(PRIO_PROCESS, static_cast<id_t>(::gettid()), kNice);  // of this thread alone
  auto made = make();
  std::unique_lock lock(mutex_);
  if (made) {
    tracker_ = std::move(*made);
    tracker_->on_update([this](const Update& u) {
      const std::lock_guard inner(mutex_);
      last_ = u;
      if (u.health == Health::ambiguous && !u.reason.empty()) ambiguous_ = u.reason;
      needs_search_ = tracker_->needs_search();
    });
    made_ = true;
  } else {
    log_detail(made.error().line());
    failed_ = true;
  }
  emptied_.notify_all();
  while (!failed_) {
    filled_.wait(lock, [this] { return stopped_ || !items_.empty(); });
    if (stopped_) break;
    const Item item = std::move(items_.front());
    items_.pop_front();
    if (const auto* packet = std::get_if<EventPacket>(&item)) waiting_ -= packet->events.size();
    busy_ = true;
    const TimeNs newest = share_.newest();
    lock.unlock();
    feed(item, newest);
    lock.lock();
    busy_ = false;
    if (items_.empty()) emptied_.notify_all();
  }
  ended_ = true;
  emptied_.notify_all();
}

std::unique_ptr<Tracker> Recovery::take() {
  {
    const std::lock_guard lock(mutex_);
    if (!last_ || last_->health != Health::tracking || last_->t < share_.newest() - kCaughtUp) return {};
    stopped_ = true;
    filled_.notify_all();
  }
  thread_.join();
  tracker_->on_update({});
  tracker_->search_no_more();
  for (const Item& item : items_) feed(item, share_.newest());
  tracker_->limit_event_share(1);
  tracker_->set_update_stride(1);
  return std::move(tracker_);
}

}  // namespace evpose
