// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/bench/experiments/realtime.h"

#include <ctime>

#include <algorithm>
#include <cstdio>
#include <future>

#include "evpose/eval/score.h"
#include "evpose/eval/statistics.h"
#include "evpose/io/events/evt3_encoder.h"
#include "evpose/serve/packets.h"
#include "evpose/serve/replay_source.h"

namespace evpose::experiments {
namespace {

constexpr TimeNs kPacket = kNsPerMs;
constexpr TimeNs kWarm =
    100 * kNsPerMs;  // the start is not counted: its memory is touched for the first time
constexpr TimeNs kBurst = 50 * kNsPerMs;

/// Processor time of this thread, which does not count what else the machine does; or of the wall.
double clock_s(clockid_t clock) {
  timespec t{};
  clock_gettime(clock, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

double rate_of(const std::vector<EventPacket>& packets) {
  std::size_t events = 0;
  for (const EventPacket& p : packets) events += p.events.size();
  return 1e-6 * static_cast<double>(events) / to_seconds(kPacket * static_cast<TimeNs>(packets.size()));
}

/// Of one run.
struct Figures {
  double events = 0, busy_s = 0, data_s = 0, shed = 0;
  std::vector<double> delay_ms;
  TrajectoryScore score;
  Health at_end = Health::waiting;

  double sustained_mev_s() const { return 1e-6 * events / busy_s; }
  double share_of_core() const { return busy_s / data_s; }
};

/// A camera's driver: the recording's packets with random events added, as words of EVT3.
class Driver {
 public:
  Driver(const Streams& streams, double rate_mev_s, double burst_mev_s)
      : streams_(streams),
        noise_per_s_(std::max(0.0, 1e6 * (rate_mev_s - rate_of(streams.packets)))),
        burst_per_s_(1e6 * burst_mev_s) {
    const TimeNs middle = (streams.packets.front().base + streams.packets.back().base) / 2;
    burst_begin_ = middle - kBurst / 2;
  }

  std::size_t packets() const { return streams_.packets.size(); }
  TimeNs base(std::size_t number) const { return streams_.packets[number].base; }

  std::vector<std::uint8_t> datagram(std::size_t number) {
    EventPacket packet = streams_.packets[number];
    const bool bursts = packet.base >= burst_begin_ && packet.base < burst_begin_ + kBurst;
    add_random_events(packet, streams_.job.recording.camera.size, packet.base + kPacket,
                      noise_per_s_ + (bursts ? burst_per_s_ : 0), random_);
    std::vector<std::uint16_t> words;
    encoder_.encode(packet.events, (packet.base - base(0)) / kNsPerUs, words);
    const auto* bytes = reinterpret_cast<const std::uint8_t*>(words.data());
    return encode_evt3_packet({bytes, 2 * words.size()}, base(0), static_cast<std::uint32_t>(number));
  }

 private:
  const Streams& streams_;
  double noise_per_s_, burst_per_s_;
  TimeNs burst_begin_;
  Evt3Encoder encoder_;
  std::uint64_t random_ = 1;
};

/// Feeds packet by packet, as they would come, and clocks each.
class Run {
 public:
  Run(const Streams& streams, const RealtimeRequest& request, double rate_mev_s)
      : streams_(streams),
        driver_(streams, rate_mev_s, request.burst_mev_s),
        decoder_(streams.job.recording.camera.size),
        two_cores_(request.two_cores) {}

  Expected<Figures> track(const TrackerConfig& config) {
    auto tracker = Tracker::create(streams_.job.setup, config, streams_.job.start);
    if (!tracker) return tracker.error();
    (*tracker)->on_update([this](const Update& u) { add(u); });
    std::vector<StreamItem> now;
    for (std::size_t number = 0; number <= driver_.packets(); ++number) now = step(**tracker, now, number);
    out_.shed = static_cast<double>((*tracker)->events().counts().shed);
    out_.score = score_trajectory({poses_, streams_.job.truth, covariances_, {}, {}}, {});
    return out_;
  }

 private:
  double now_s() const { return clock_s(two_cores_ ? CLOCK_MONOTONIC : CLOCK_THREAD_CPUTIME_ID); }

  /// Tracks a packet's events while the next one is decoded.
  std::vector<StreamItem> step(Tracker& tracker, const std::vector<StreamItem>& now, std::size_t next) {
    const bool more = next < driver_.packets();
    const auto words = more ? driver_.datagram(next) : std::vector<std::uint8_t>{};
    const double began_s = now_s();
    auto decoded = std::async(two_cores_ ? std::launch::async : std::launch::deferred, [&] {
      std::vector<StreamItem> items;
      if (more) decoder_.datagram(words, items);
      return items;
    });
    feed(tracker, now);
    std::vector<StreamItem> out = decoded.get();
    if (!more || driver_.base(next) <= streams_.job.start.t + kWarm) return out;
    out_.busy_s += now_s() - began_s;
    out_.data_s += to_seconds(kPacket);
    for (const StreamItem& item : out) out_.events += static_cast<double>(item.events.events.size());
    return out;
  }

  void feed(Tracker& tracker, const std::vector<StreamItem>& items) {
    for (const StreamItem& item : items) {
      if (item.events.empty()) continue;
      const TimeNs end = item.events.time(item.events.events.back());
      for (; imu_ < streams_.imu.size() && streams_.imu[imu_].t <= end + 2 * kPacket; ++imu_)
        tracker.add_imu(streams_.imu[imu_]);
      waited_from_s_ = now_s();
      tracker.add_events(item.events);
    }
  }

  void add(const Update& u) {
    poses_.push_back({u.t, u.T_map_body});
    covariances_.push_back(u.covariance);
    out_.at_end = u.health;
    if (u.t > streams_.job.start.t + kWarm) out_.delay_ms.push_back(1e3 * (now_s() - waited_from_s_));
    waited_from_s_ = now_s();
  }

  const Streams& streams_;
  Driver driver_;
  PacketDecoder decoder_;
  bool two_cores_;
  std::size_t imu_ = 0;
  double waited_from_s_ = 0;  ///< the packet came, or the last update of its time was made
  Figures out_;
  std::vector<TimedPose> poses_;
  std::vector<Matrix6d> covariances_;
};

/// Over the runs, of what `figure` takes of each.
template <class Figure>
double median(const std::vector<Figures>& runs, const Figure& figure) {
  std::vector<double> values;
  for (const Figures& f : runs) values.push_back(figure(f));
  std::sort(values.begin(), values.end());
  return quantile(values, 0.5);
}

/// All runs give the same poses.
void print_row(const std::string& name, ImageSize size, double rate_mev_s, double updates_hz, bool streams,
               const std::vector<Figures>& runs) {
  const auto delay_ms = [&](double share) {
    return median(runs, [&](const Figures& f) { return quantile(f.delay_ms, share); });
  };
  std::printf(
      "| %s | %dx%d | %.0f | %.0f | %s | %s | %.2f | %.1f | %.0f %% | %.2f / %.2f / %.2f | %.1f %% |\n",
      name.c_str(), size.width, size.height, rate_mev_s, updates_hz,
      streams ? "as they come" : "at the update", to_string(runs.front().at_end),
      runs.front().score.ate_mm.mean, median(runs, [](const Figures& f) { return f.sustained_mev_s(); }),
      100 * median(runs, [](const Figures& f) { return f.share_of_core(); }), delay_ms(0.5), delay_ms(0.99),
      delay_ms(1), 100 * runs.front().shed / std::max(1.0, runs.front().events));
  std::fflush(stdout);
}

Status print_rate(const Streams& streams, const std::string& name, const RealtimeRequest& request,
                  TrackerConfig config, double rate_mev_s) {
  for (const bool streaming : request.beside_batch ? std::vector{true, false} : std::vector{true}) {
    config.streams = streaming;
    std::vector<Figures> runs;
    for (int i = 0; i < request.runs; ++i) {
      auto figures = Run(streams, request, rate_mev_s).track(config);
      if (!figures) return figures.error();
      std::sort(figures->delay_ms.begin(), figures->delay_ms.end());
      runs.push_back(std::move(*figures));
    }
    print_row(name, streams.job.recording.camera.size, std::max(rate_of(streams.packets), rate_mev_s),
              config.rate_hz, streaming, runs);
  }
  return {};
}

Status print_recording(const BenchRecording& recording, const RealtimeRequest& request) {
  auto config = configure(request.selection.assignments);
  if (!config) return config.error();
  config->packet_ms = 1e3 * to_seconds(kPacket);
  const auto streams = load_streams(recording, *config);
  if (!streams) return streams.error();
  for (const double rate_mev_s : request.rates_mev_s)
    for (const double updates_hz : request.updates_hz) {
      config->tracker.rate_hz = updates_hz;
      if (auto ok = print_rate(*streams, recording.name, request, config->tracker, rate_mev_s); !ok)
        return ok;
    }
  return {};
}

}  // namespace

Status print_realtime(const RealtimeRequest& request) {
  const auto recordings = select_recordings(request.selection);
  if (!recordings) return recordings.error();
  std::printf(
      "| recording | image | Mev/s | updates a second | associated | at the end | ATE mm | sustained Mev/s | "
      "share of a "
      "core "
      "| newest event to pose, ms: p50 / p99 / max | shed "
      "|\n|---|---|---|---|---|---|---|---|---|---|---|\n");
  for (const BenchRecording& recording : *recordings)
    if (auto ok = print_recording(recording, request); !ok) return ok;
  return {};
}

}  // namespace evpose::experiments
