// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/serve/session.h"

#include <algorithm>
#include <cmath>

#include "evpose/core/config.h"

namespace evpose {
namespace {

constexpr std::size_t kBefore = 2000;           // IMU samples kept before there is a tracker
constexpr TimeNs kLate = 10 * kNsPerMs;         // what is later than this is a clock that went back
constexpr TimeNs kOffsetWindow = 10 * kNsPerS;  // the shortest way of this time tells the clocks' offset

}  // namespace

void describe(ConfigTable& table, SessionConfig& c) {
  table.add("stall_s", c.stall_s, "s", "wall time without data after which a stream is called stalled",
            {0.01, 1e4});
  table.add("largest_gap_s", c.largest_gap_s, "s",
            "data time without data after which the tracker starts anew", {0.01, 1e4});
  table.add("imu_only_s", c.imu_only_s, "s", "data time without events that the IMU alone bridges", {0, 1e4});
  table.add("wait_imu_s", c.wait_imu_s, "s", "events further ahead of the IMU are shed", {0.001, 10});
}

Session::Session(const SessionConfig& config, bool has_imu, const StartState& start,
                 std::optional<TimeNs> start_at, MakeTracker make, Hooks hooks)
    : config_(config),
      has_imu_(has_imu),
      start_(start),
      next_(start),
      first_start_at_(start_at),
      start_at_(start_at),
      make_(std::move(make)),
      hooks_(std::move(hooks)) {}

void Session::learn_offset(const StreamItem& item, TimeNs newest) {
  if (item.data_to_monotonic) {
    offset_ = *item.data_to_monotonic;
    return;
  }
  const TimeNs way = item.arrived_ns - newest;
  if (newest > window_end_) {
    window_end_ = newest + kOffsetWindow;
    if (has_offset_) offset_ = std::min(window_min_, way);
    window_min_ = way;
  }
  window_min_ = std::min(window_min_, way);
  offset_ = has_offset_ ? std::min(offset_, way) : way;
  has_offset_ = true;
}

void Session::arrived(Stream& stream, TimeNs now_ns) const {
  stream.arrived = now_ns;
  if (!stream.stalled) return;
  stream.stalled = false;
  hooks_.notice(std::string(stream.name) + " are coming again");
}

void Session::check_stall(Stream& stream, TimeNs now_ns) {
  if (!stream.any() || stream.stalled || to_seconds(now_ns - stream.arrived) < config_.stall_s) return;
  stream.stalled = true;
  ++counts_.stalls;
  const std::string what = text("no ", stream.name, " for ", config_.stall_s, " s");
  hooks_.notice(what);
  hooks_.stalled(what);
}

void Session::tick(TimeNs now_ns) {
  check_stall(events_, now_ns);
  if (has_imu_) check_stall(imu_, now_ns);
}

void Session::reset(const std::string& why) { restart(why, false); }

void Session::restart(const std::string& why, bool from_last) {
  if (tracker_) {
    counts_.events_kept += static_cast<std::uint64_t>(tracker_->events().counts().kept);
    counts_.events_thinned += static_cast<std::uint64_t>(tracker_->events().counts().shed);
  }
  tracker_.reset();
  before_.clear();
  events_.last = imu_.last = std::numeric_limits<TimeNs>::min();
  has_offset_ = false;
  window_end_ = std::numeric_limits<TimeNs>::min();
  ++counts_.restarts;
  shedding_ = refused_ = false;
  again_ = from_last && last_valid_.has_value();
  next_ = start_;
  start_at_ = again_ ? std::nullopt : first_start_at_;
  if (again_) {
    next_.T_map_body = last_valid_->T_map_body;
    next_.velocity.setZero();  // nobody knows what happened meanwhile
    next_.angular_rate_body.setZero();
  }
  last_valid_.reset();
  hooks_.notice("restarted: " + why);
  hooks_.restarted(why);
}

bool Session::bridged_by_imu(const Stream& stream, TimeNs t) const {
  return &stream == &events_ && has_imu_ && imu_.any() && to_seconds(t - imu_.last) <= config_.wait_imu_s &&
         to_seconds(t - stream.last) <= config_.imu_only_s;
}

bool Session::follows(Stream& stream, TimeNs t) {
  if (!stream.any()) return true;
  if (t < stream.last - kLate) {
    restart(text("the clock of the ", stream.name, " went back by ", to_seconds(stream.last - t), " s"),
            true);
    return true;
  }
  if (to_seconds(t - stream.last) > config_.largest_gap_s && !bridged_by_imu(stream, t)) {
    restart(text("no ", stream.name, " for ", to_seconds(t - stream.last), " s of their clock"), true);
    return true;
  }
  return t >= stream.last;
}

void Session::take(StreamItem& item, TimeNs now_ns) {
  switch (item.kind) {
    case StreamItem::Kind::events:
      if (item.events.empty()) {  // all of it was shed
        arrived(events_, now_ns);
        return;
      }
      if (!follows(events_, item.events.base) && item.events.time(item.events.events.back()) < events_.last) {
        counts_.events_late += item.events.events.size();
        return;
      }
      learn_offset(item, item.events.time(item.events.events.back()));
      if (tracker_) {
        tracker_->limit_event_share(item.share);
        tracker_->set_update_stride(item.stride);
      }
      return take_events(item.events, now_ns);
    case StreamItem::Kind::imu:
      return take_imu(item.imu, now_ns);
    case StreamItem::Kind::notice:
      return hooks_.notice(item.words);
    case StreamItem::Kind::restart:
      return reset(item.words);
    case StreamItem::Kind::end:
      return;
  }
}

void Session::take_imu(const std::vector<ImuSample>& samples, TimeNs now_ns) {
  if (!has_imu_) return;
  arrived(imu_, now_ns);
  for (const ImuSample& sample : samples) {
    if (!follows(imu_, sample.t) || sample.t == imu_.last) {
      ++counts_.imu_late;
      continue;
    }
    imu_.last = sample.t;
    ++counts_.imu;
    if (tracker_) {
      tracker_->add_imu(sample);
      continue;
    }
    before_.push_back(sample);
    if (before_.size() > kBefore) before_.pop_front();
  }
}

bool Session::create(const StartState& start) {
  auto made = make_(start, again_);
  if (!made) {
    if (!refused_) hooks_.notice(made.error().line());
    refused_ = true;
    return false;
  }
  tracker_ = std::move(*made);
  tracker_->on_update([this](const Update& u) {
    ++counts_.updates;
    if (u.health == Health::tracking || u.health == Health::degraded) last_valid_ = u;
    hooks_.update(u, offset_, *tracker_);
  });
  for (const ImuSample& sample : before_) tracker_->add_imu(sample);
  before_.clear();
  return true;
}

bool Session::begin(TimeNs first_event) {
  if (tracker_) return true;
  StartState start = next_;
  if (start_at_) {
    start.t = *start_at_;
    return create(start);
  }
  if (has_imu_ && before_.empty()) return false;
  start.t = has_imu_ ? std::max(first_event, before_.front().t) : first_event;
  return create(start);
}

void Session::take_events(EventPacket& packet, TimeNs now_ns) {
  arrived(events_, now_ns);
  std::vector<Event>& events = packet.events;
  // A packet may reach back a little behind the one before.
  const auto sound = std::find_if(events.begin(), events.end(),
                                  [&](const Event& e) { return packet.time(e) >= events_.last; });
  counts_.events_late += static_cast<std::uint64_t>(sound - events.begin());
  events.erase(events.begin(), sound);
  if (events.empty()) return;
  counts_.events += events.size();
  const TimeNs newest = packet.time(events.back());
  events_.last = newest;
  const bool ahead = has_imu_ && imu_.any() && to_seconds(newest - imu_.last) > config_.wait_imu_s;
  if (ahead || !begin(packet.time(events.front()))) {
    counts_.events_shed += events.size();
    if (ahead && !shedding_) hooks_.notice("events wait for the IMU: shed until it comes");
    shedding_ = ahead;
    return;
  }
  shedding_ = false;
  tracker_->add_events(packet);
}

}  // namespace evpose
