// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/bench/experiments/streams.h"

#include <algorithm>

#include "evpose/io/recording/recording.h"

namespace evpose::experiments {

Expected<Streams> load_streams(const TrackRequest& request, const RunConfig& config) {
  auto job = prepare(request, config);
  if (!job) return job.error();
  Streams out;
  out.job = std::move(*job);
  out.job.setup.calibration_sigma.reset();
  auto events = open_events(out.job.recording, 1e-3 * config.packet_ms);
  if (!events) return events.error();
  for (EventPacket packet;;) {
    const auto more = (*events)->next(packet);
    if (!more) return more.error();
    if (!*more) break;
    out.packets.push_back(packet);
  }
  if (!out.job.recording.has_imu) return out;
  auto imu = open_imu(out.job.recording);
  if (!imu) return imu.error();
  for (ImuSample sample;;) {
    const auto more = imu->next(sample);
    if (!more) return more.error();
    if (!*more) return out;
    out.imu.push_back(sample);
  }
}

void feed(const std::vector<EventPacket>& packets, const std::vector<ImuSample>& imu, Tracker& tracker) {
  auto next = imu.begin();
  for (const EventPacket& packet : packets) {
    if (packet.empty()) continue;
    const TimeNs end = packet.time(packet.events.back());
    for (bool reached = false; next != imu.end() && !reached; ++next) {
      tracker.add_imu(*next);
      reached = next->t > end;
    }
    tracker.add_events(packet);
  }
}

Excerpt excerpt(const Streams& streams, TimeNs begin, TimeNs end) {
  constexpr TimeNs kBeside = 20 * kNsPerMs;
  Excerpt out;
  for (const EventPacket& p : streams.packets)
    if (!p.empty() && p.time(p.events.front()) >= begin && p.time(p.events.back()) < end)
      out.packets.push_back(p);
  for (const ImuSample& s : streams.imu)
    if (s.t >= begin - kBeside && s.t < end + kBeside) out.imu.push_back(s);
  return out;
}

Pose true_pose(const std::vector<TimedPose>& truth, TimeNs t) {
  const auto after = std::lower_bound(truth.begin() + 1, truth.end() - 1, t,
                                      [](const TimedPose& p, TimeNs time) { return p.t < time; });
  const auto before = after - 1;
  return interpolate(before->pose, after->pose,
                     static_cast<double>(t - before->t) / static_cast<double>(after->t - before->t));
}

StartState start_at(const std::vector<TimedPose>& truth, TimeNs t) {
  const TimeNs h = 5 * kNsPerMs;
  const Pose a = true_pose(truth, t - h), b = true_pose(truth, t + h);
  StartState out;
  out.t = t;
  out.T_map_body = true_pose(truth, t);
  out.velocity = (b.p - a.p) / to_seconds(2 * h);
  out.angular_rate_body = so3::log(a.q.conjugate() * b.q) / to_seconds(2 * h);
  return out;
}

}  // namespace evpose::experiments
