// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/serve/replay_source.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <thread>

#include "evpose/core/config.h"

namespace evpose {
namespace {

using Clock = std::chrono::steady_clock;

constexpr TimeNs kLongestSleep = 50 * kNsPerMs;  // so that a closed queue is soon noticed

TimeNs now_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(Clock::now().time_since_epoch()).count();
}

/// Data time to the wall's; sleeps until it is due.
class Pace {
 public:
  Pace(double speed, TimeNs start) : speed_(speed), start_(start), wall_start_(now_ns()) {}

  TimeNs wall(TimeNs t) const {
    return speed_ > 0 ? wall_start_ + static_cast<TimeNs>(static_cast<double>(t - start_) / speed_)
                      : now_ns();
  }
  /// False: the queue was closed meanwhile.
  bool wait_until(TimeNs t, const StreamQueue& queue) const {
    if (speed_ <= 0) return !queue.closed();
    while (true) {
      const TimeNs left = wall(t) - now_ns();
      if (left <= 0) return true;
      if (left > kNsPerMs && queue.closed()) return false;
      std::this_thread::sleep_for(std::chrono::nanoseconds(std::min(left, kLongestSleep)));
    }
  }

 private:
  double speed_;
  TimeNs start_, wall_start_;
};

StreamItem item_of(StreamItem::Kind kind, std::string words = "") {
  StreamItem item;
  item.kind = kind;
  item.words = std::move(words);
  return item;
}

}  // namespace

void add_random_events(EventPacket& packet, ImageSize size, TimeNs until, double per_s,
                       std::uint64_t& state) {
  const double span_s = to_seconds(until - packet.base);
  const auto count = static_cast<std::size_t>(std::llround(per_s * span_s));
  std::vector<Event> noise(count);
  const double step_us = 1e6 * span_s / static_cast<double>(std::max<std::size_t>(count, 1));
  for (std::size_t i = 0; i < count; ++i) {
    std::uint64_t r = state += 0x9E3779B97F4A7C15;
    r = (r ^ (r >> 30)) * 0xBF58476D1CE4E5B9;
    r = (r ^ (r >> 27)) * 0x94D049BB133111EB;
    const auto x = static_cast<int>((r >> 48) * static_cast<std::uint64_t>(size.width) >> 16);
    const auto y = static_cast<int>((r >> 32 & 0xFFFF) * static_cast<std::uint64_t>(size.height) >> 16);
    noise[i] =
        make_event(static_cast<std::uint32_t>(step_us * static_cast<double>(i)), x, y, (r >> 31 & 1) == 1);
  }
  std::vector<Event> all(packet.events.size() + count);
  std::merge(packet.events.begin(), packet.events.end(), noise.begin(), noise.end(), all.begin(),
             [](const Event& a, const Event& b) { return a.dt_us < b.dt_us; });
  packet.events = std::move(all);
}

void describe(ConfigTable& table, ReplayConfig& c) {
  table.add("speed", c.speed, "", "data time against the wall clock; 0: as fast as it is taken", {0, 1000});
  table.add("packet_ms", c.packet_ms, "ms", "events come in packets of this length, when it ends",
            {1e-2, 1e3});
  table.add("loop", c.loop, "start again at the end, for ever");
  table.add("add_noise_mev_s", c.add_noise_mev_s, "1e6/s", "events at random pixels, to test the load",
            {0, 1000});
}

Status ReplaySource::run_once(StreamQueue& queue) {
  auto reader = open_events(recording_, 1e-3 * config_.packet_ms);
  if (!reader) return reader.error();
  std::optional<ImuReader> imu;
  if (recording_.has_imu) {
    auto opened = open_imu(recording_);
    if (!opened) return opened.error();
    imu = std::move(*opened);
  }
  std::uint64_t random = 1;
  const TimeNs length = from_seconds(1e-3 * config_.packet_ms);
  EventPacket packet;
  ImuSample sample;
  bool has_sample = false;
  const auto next_imu = [&]() -> Status {
    if (!imu) return {};
    const auto more = imu->next(sample);
    if (!more) return more.error();
    has_sample = *more;
    return {};
  };
  if (auto ok = next_imu(); !ok) return ok;
  std::optional<Pace> pace;
  while (true) {
    const auto more = (*reader)->next(packet);
    if (!more) return more.error();
    if (!*more) break;
    // Packets end at multiples of their length.
    const TimeNs end = (packet.base / length + 1) * length;
    if (!pace) pace.emplace(config_.speed, packet.base);
    StreamItem events = item_of(StreamItem::Kind::events), samples = item_of(StreamItem::Kind::imu);
    if (config_.add_noise_mev_s > 0)
      add_random_events(packet, recording_.camera.size, end, 1e6 * config_.add_noise_mev_s, random);
    for (; has_sample && sample.t <= end;) {
      samples.imu.push_back(sample);
      if (auto ok = next_imu(); !ok) return ok;
    }
    if (!pace->wait_until(end, queue)) return {};
    events.events = std::move(packet);
    packet = {};
    events.data_to_monotonic = samples.data_to_monotonic = pace->wall(end) - end;
    if (!samples.imu.empty() && !queue.push(std::move(samples))) return {};
    if (!queue.push(std::move(events))) return {};
  }
  // The first sample after the last events is what the last update waits for.
  if (has_sample) {
    StreamItem last = item_of(StreamItem::Kind::imu);
    last.imu = {sample};
    queue.push(std::move(last));
  }
  return {};
}

void ReplaySource::run(StreamQueue& queue) {
  do {
    if (const Status done = run_once(queue); !done) {
      queue.push(item_of(StreamItem::Kind::notice, done.error().line()));
      break;
    }
    if (config_.loop) queue.push(item_of(StreamItem::Kind::restart, "the recording starts again"));
  } while (config_.loop && !queue.closed());
  queue.push(item_of(StreamItem::Kind::end));
}

}  // namespace evpose
