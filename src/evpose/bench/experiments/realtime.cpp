// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/bench/experiments/realtime.h"

#include <ctime>

#include <algorithm>
#include <cstdio>

#include "evpose/eval/score.h"
#include "evpose/eval/statistics.h"
#include "evpose/serve/replay_source.h"

namespace evpose::experiments {
namespace {

constexpr TimeNs kPacket = kNsPerMs;
constexpr TimeNs kWarm =
    100 * kNsPerMs;  // the start is not counted: its memory is touched for the first time

/// Processor time of this thread: what else the machine does is not counted.
double clock_s() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

double rate_of(const std::vector<EventPacket>& packets) {
  std::size_t events = 0;
  for (const EventPacket& p : packets) events += p.events.size();
  return 1e-6 * static_cast<double>(events) / to_seconds(kPacket * static_cast<TimeNs>(packets.size()));
}

struct Figures {
  double events = 0, busy_s = 0, data_s = 0, shed = 0;
  std::vector<double> delay_ms;
  TrajectoryScore score;
  Health at_end = Health::waiting;
};

/// Feeds packet by packet, as they would come, and clocks each.
class Run {
 public:
  Run(const Streams& streams, double rate_mev_s) : streams_(streams) {
    noise_per_s_ = std::max(0.0, 1e6 * (rate_mev_s - rate_of(streams.packets)));
  }

  Expected<Figures> track(const TrackerConfig& config) {
    auto tracker = Tracker::create(streams_.job.setup, config, streams_.job.start);
    if (!tracker) return tracker.error();
    (*tracker)->on_update([this](const Update& u) { add(u); });
    auto imu = streams_.imu.begin();
    for (const EventPacket& own : streams_.packets) {
      EventPacket packet = own;
      const TimeNs end = packet.base + kPacket;
      add_random_events(packet, streams_.job.recording.camera.size, end, noise_per_s_, random_);
      if (packet.empty()) continue;
      const bool counted = packet.base > streams_.job.start.t + kWarm;
      for (; imu != streams_.imu.end() && imu->t <= end + kPacket; ++imu) (*tracker)->add_imu(*imu);
      const double began_s = waited_from_s_ = clock_s();
      (*tracker)->add_events(packet);
      if (!counted) continue;
      out_.busy_s += clock_s() - began_s;
      out_.data_s += to_seconds(kPacket);
      out_.events += static_cast<double>(packet.events.size());
    }
    out_.shed = static_cast<double>((*tracker)->events().counts().shed);
    out_.score = score_trajectory({poses_, streams_.job.truth, covariances_, {}, {}}, {});
    return out_;
  }

 private:
  void add(const Update& u) {
    poses_.push_back({u.t, u.T_map_body});
    covariances_.push_back(u.covariance);
    out_.at_end = u.health;
    if (u.t > streams_.job.start.t + kWarm) out_.delay_ms.push_back(1e3 * (clock_s() - waited_from_s_));
    waited_from_s_ = clock_s();
  }

  const Streams& streams_;
  double noise_per_s_;
  double waited_from_s_ = 0;  ///< the packet came, or the last update of its time was made
  std::uint64_t random_ = 1;
  Figures out_;
  std::vector<TimedPose> poses_;
  std::vector<Matrix6d> covariances_;
};

void print_row(const std::string& name, ImageSize size, double rate_mev_s, double updates_hz, Figures f) {
  std::sort(f.delay_ms.begin(), f.delay_ms.end());
  std::printf("| %s | %dx%d | %.0f | %.0f | %s | %.2f | %.1f | %.0f %% | %.2f / %.2f / %.2f | %.1f %% |\n",
              name.c_str(), size.width, size.height, rate_mev_s, updates_hz, to_string(f.at_end),
              f.score.ate_mm.mean, 1e-6 * f.events / f.busy_s, 100 * f.busy_s / f.data_s,
              quantile(f.delay_ms, 0.5), quantile(f.delay_ms, 0.99), f.delay_ms.back(),
              100 * f.shed / std::max(1.0, f.events));
  std::fflush(stdout);
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
      const auto figures = Run(*streams, rate_mev_s).track(config->tracker);
      if (!figures) return figures.error();
      const double own = rate_of(streams->packets);
      print_row(recording.name, streams->job.recording.camera.size, std::max(own, rate_mev_s), updates_hz,
                *figures);
    }
  return {};
}

}  // namespace

Status print_realtime(const RealtimeRequest& request) {
  const auto recordings = select_recordings(request.selection);
  if (!recordings) return recordings.error();
  std::printf(
      "| recording | image | Mev/s | updates a second | at the end | ATE mm | sustained Mev/s | share of a "
      "core "
      "| newest event to pose, ms: p50 / p99 / max | shed |\n|---|---|---|---|---|---|---|---|---|---|\n");
  for (const BenchRecording& recording : *recordings)
    if (auto ok = print_recording(recording, request); !ok) return ok;
  return {};
}

}  // namespace evpose::experiments
