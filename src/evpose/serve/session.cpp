// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/serve/session.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "evpose/core/config.h"

namespace evpose {
namespace {

constexpr std::size_t kBefore = 2000;           // IMU samples kept before there is a tracker
constexpr TimeNs kLate = 10 * kNsPerMs;         // what is later than this is a clock that went back
constexpr TimeNs kOffsetWindow = 10 * kNsPerS;  // the shortest way of this time tells the clocks' offset

// Of a pose that is some time old. By then it may have moved on, at any speed.
constexpr double kAgainPosition_m = 0.03, kAgainRotation_rad = 0.02, kAgainSpeed_m_s = 0.5;
constexpr double kMovedOn_m_s = 1, kMostMovedOn_m = 5, kTurnedOn_rad_s = 0.5;

// Searches for a pose, one after the other: around where it should be, as by GPS and compass, anywhere. The
// first two for so long, of data.
constexpr int kAround = 0, kByGps = 1, kAnywhere = 2;
constexpr TimeNs kLongest[] = {4 * kNsPerS, 12 * kNsPerS};
constexpr double kAnywhere_m = 1e3, kAnywhere_rad = M_PI;
constexpr TimeNs kBetween = kNsPerS / 10;  // begins of searches: one may fail at once

int width_of(const TrackerStart& start) {
  return start.position_sigma_m < kByGps_m      ? kAround
         : start.position_sigma_m < kAnywhere_m ? kByGps
                                                : kAnywhere;
}

}  // namespace

void describe(ConfigTable& table, SessionConfig& c) {
  table.add("stall_s", c.stall_s, "s", "wall time without data after which a stream is called stalled",
            {0.01, 1e4});
  table.add("largest_gap_s", c.largest_gap_s, "s",
            "data time without data after which the tracker starts anew", {0.01, 1e4});
  table.add("imu_only_s", c.imu_only_s, "s", "data time without events that the IMU alone bridges", {0, 1e4});
  table.add("wait_imu_s", c.wait_imu_s, "s", "events further ahead of the IMU are shed", {0.001, 10});
}

Session::Session(const SessionConfig& config, bool has_imu, const TrackerStart& start,
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
  if (config_.waits) return;  // so does the source
  check_stall(events_, now_ns);
  if (has_imu_) check_stall(imu_, now_ns);
}

void Session::reset(const std::string& why) { restart(why, false); }

void Session::count_tracker() {
  if (!tracker_) return;
  counts_.events_kept += static_cast<std::uint64_t>(tracker_->events().counts().kept);
  counts_.events_thinned += static_cast<std::uint64_t>(tracker_->events().counts().shed);
}

void Session::restart(const std::string& why, bool from_last) {
  count_tracker();
  tracker_.reset();
  end_search();
  before_.clear();
  const TimeNs was_at = events_.last;
  events_.last = imu_.last = std::numeric_limits<TimeNs>::min();
  has_offset_ = false;
  window_end_ = std::numeric_limits<TimeNs>::min();
  ++counts_.restarts;
  shedding_ = refused_ = false;
  again_ = from_last && last_valid_.has_value();
  next_ = start_;
  start_at_ = again_ ? std::nullopt : first_start_at_;
  if (again_) {
    next_ = {{was_at, last_valid_->T_map_body}, kAgainPosition_m, kAgainRotation_rad, kAgainSpeed_m_s};
    // Nobody knows how it moved meanwhile.
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
    if (tracker_ || searching_) {
      add_sample(sample);
      continue;
    }
    before_.push_back(sample);
    if (before_.size() > kBefore) before_.pop_front();
  }
}

bool Session::create(TrackerStart start) {
  auto made = make_(start);
  if (!made) {
    if (!refused_) hooks_.notice(made.error().line());
    refused_ = true;
    return false;
  }
  // What takes seconds of a core is done beside: a search, and the alignment of the first view.
  const bool searches = again_ || (*made)->needs_search();
  const bool slow = (*made)->aligns_start() || (searches && !again_);
  if (!slow || !config_.search.on) use(std::move(*made));
  if (config_.search.on && (slow || again_)) {
    // After a gap whichever is tracking first: this one, or one that is not where it was.
    if (again_) start = moved_on(start);
    start.searches = searches;
    width_ = width_of(start);
    begin_beside(start);
  }
  for (const ImuSample& sample : before_) add_sample(sample);
  before_.clear();
  return true;
}

/// A start from where it was when the data ended.
TrackerStart Session::moved_on(TrackerStart start) const {
  const double gap_s = std::max(0.0, to_seconds(start.state.t - next_.state.t));
  start.position_sigma_m = config_.search.position_sigma_m + std::min(kMostMovedOn_m, kMovedOn_m_s * gap_s);
  start.rotation_sigma_rad = config_.search.rotation_sigma_rad + std::min(M_PI, kTurnedOn_rad_s * gap_s);
  return start;
}

/// From now on the poses are those of this one.
void Session::use(std::unique_ptr<Tracker> tracker) {
  tracker_ = std::move(tracker);
  tracker_->on_update([this](const Update& u) {
    ++counts_.updates;
    tracks_ = u.health == Health::tracking;
    if (tracks_ || u.health == Health::degraded) last_valid_ = u;
    hooks_.update(u, offset_, *tracker_);
  });
}

/// Where the pose should be, at the width of the next search.
TrackerStart Session::where_to_search() const {
  TrackerStart out = start_;
  if (width_ == kAround && tracker_) {
    const FusionState& state = tracker_->state();
    const Vector6d variance = state.pose_covariance().diagonal();
    const auto sigma = [](double of_search, double variances) {
      return std::hypot(of_search, std::sqrt(variances));
    };
    out = {{0, state.nav.T_map_body, state.nav.velocity},
           sigma(config_.search.position_sigma_m, variance.head<3>().maxCoeff()),
           sigma(config_.search.rotation_sigma_rad, variance.tail<3>().maxCoeff())};
  } else if (last_valid_) {
    out = {{0, last_valid_->T_map_body}};
  }
  out.position_sigma_m = std::max(out.position_sigma_m, config_.search.position_sigma_m);
  out.rotation_sigma_rad = std::max(out.rotation_sigma_rad, config_.search.rotation_sigma_rad);
  if (const auto told = width_ == kByGps && hooks_.whereabouts ? hooks_.whereabouts() : std::nullopt) {
    out = *told;
  } else if (width_ >= kByGps) {
    out.position_sigma_m = width_ == kAnywhere ? kAnywhere_m : kByGps_m;
    out.rotation_sigma_rad = width_ == kAnywhere ? kAnywhere_rad : kByCompass_rad;
  }
  out.searches = true;
  out.state.t = has_imu_ ? std::max(events_.last, imu_.last) : events_.last;
  return out;
}

void Session::begin_beside(const TrackerStart& from) {
  searching_ = true;
  search_began_ = from.state.t;
  counts_.searches += from.searches ? 1 : 0;
  by_search_ = from.searches;
  recovery_ = std::make_unique<Recovery>([make = make_, from] { return make(from); }, config_.waits);
}

/// Its thread may be in the middle of something.
void Session::give_up_search() {
  if (!recovery_) return;
  recovery_->give_up();
  if (!config_.waits) given_up_.push_back(std::move(recovery_));
  recovery_.reset();
}

void Session::end_search() {
  give_up_search();
  searching_ = tracks_ = false;
  search_began_ = kNever;
  width_ = kAround;
}

/// Takes what a search has found, begins one when the pose is lost, and ends it when it is there again.
void Session::mind_search() {
  std::erase_if(given_up_, [](const auto& r) { return r->ended(); });
  if (const std::string poses = recovery_ ? recovery_->take_ambiguous() : ""; !poses.empty())
    hooks_.ambiguous(poses);
  if (auto found = recovery_ ? recovery_->take() : nullptr) {
    count_tracker();
    use(std::move(found));
    end_search();
    counts_.found += by_search_ ? 1 : 0;
    if (by_search_) hooks_.notice("the pose was found");
    if (counts_.updates > 0) hooks_.restarted("the pose was found");
  } else if (recovery_ && tracker_ && tracks_) {
    end_search();
  } else if (recovery_) {
    const bool long_enough = width_ < kAnywhere && has_imu_ && !recovery_->tracks() &&
                             recovery_->reached() - search_began_ > kLongest[width_];
    const bool astray = recovery_->needs_search();
    if (!long_enough && !astray && !recovery_->failed()) return;
    give_up_search();
    if (has_imu_ && !astray) width_ = std::min(width_ + 1, kAnywhere);
  } else if (config_.search.on && (searching_ || (tracker_ && tracker_->needs_search())) &&
             given_up_.empty() && events_.last >= search_began_ + kBetween) {
    begin_beside(where_to_search());
  }
}

void Session::add_sample(const ImuSample& sample) {
  if (tracker_) tracker_->add_imu(sample);
  if (recovery_) recovery_->add_imu(sample);
}

bool Session::begin(TimeNs first_event) {
  if (tracker_ || searching_) return true;
  TrackerStart start = next_;
  if (start_at_) {
    start.state.t = *start_at_;
    return create(start);
  }
  if (has_imu_ && before_.empty()) return false;
  start.state.t = has_imu_ ? std::max(first_event, before_.front().t) : first_event;
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
  if (tracker_) tracker_->add_events(packet);
  if (recovery_) recovery_->add_events(packet);
  mind_search();
}

}  // namespace evpose
