// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/bench/experiments/kidnapping.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>

#include "evpose/bench/experiments/streams.h"
#include "evpose/core/parallel.h"
#include "evpose/serve/session.h"

namespace evpose::experiments {
namespace {

constexpr double kBefore_s = 0.4, kAfter_s = 1, kBack_m = 0.01;
constexpr double kSpare_s = 0.1;  // at the recording's ends

struct Outcome {
  double back_after_s = -1;  ///< to stay, of the data that came again
  double moved_m = 0;        ///< while there were no data
  bool wrong = false;        ///< ever called tracking further off than kBack_m and five of its sigmas
};

/// Feeds what lies between two times, the IMU ahead of the events.
void feed(const Streams& streams, TimeNs begin, TimeNs end, Session& session) {
  auto [packets, imu] = excerpt(streams, begin, end);
  auto sample = imu.begin();
  for (EventPacket& packet : packets) {
    if (packet.empty()) continue;
    const TimeNs until = packet.time(packet.events.back());
    StreamItem motion, events;
    motion.kind = StreamItem::Kind::imu;
    for (; sample != imu.end() && (motion.imu.empty() || motion.imu.back().t < until); ++sample)
      motion.imu.push_back(*sample);
    session.take(motion, until);
    events.kind = StreamItem::Kind::events;
    events.events = std::move(packet);
    session.take(events, until);
  }
}

Outcome kidnap(const Streams& streams, double cut_s, unsigned seed) {
  std::mt19937 random(seed);
  const std::vector<TimedPose>& truth = streams.job.truth;
  const double share = (static_cast<double>(random()) + 0.5) / 4294967296.0;
  const TimeNs first = truth.front().t + 10 * kNsPerMs;
  const double slack_s = to_seconds(truth.back().t - first) - kBefore_s - cut_s - kAfter_s - 0.5 * kSpare_s;
  const TimeNs begin = first + from_seconds(share * std::max(1e-3, slack_s));
  const TimeNs gone = begin + from_seconds(kBefore_s), again = gone + from_seconds(cut_s);
  const TimeNs end = again + from_seconds(kAfter_s);
  Outcome out;
  out.moved_m = (true_pose(truth, again).p - true_pose(truth, gone).p).norm();
  SessionConfig config;
  config.search = streams.job.config.tracker.relocalization;
  config.search.on = true;
  config.waits = true;
  const auto judge = [&](const Update& u, TimeNs, Tracker&) {
    if (u.t < again) return;
    const bool tracking = u.health == Health::tracking;
    const Vector6d e = u.T_map_body.minus(true_pose(truth, u.t));
    const bool back = tracking && e.head<3>().norm() < kBack_m;
    if (!back) out.back_after_s = -1;
    if (back && out.back_after_s < 0) out.back_after_s = to_seconds(u.t - again);
    const auto sigma = u.covariance.diagonal().head<3>().cwiseSqrt().array();
    out.wrong |= tracking && !back && (e.head<3>().cwiseAbs().array() > 5 * sigma).any();
  };
  Session session(config, true, {start_at(truth, begin)}, begin,
                  [&](const TrackerStart& start) {
                    return make_tracker(streams.job.setup, streams.job.config.tracker, start);
                  },
                  {judge, [](const std::string&) {}, [](const std::string&) {}, [](const std::string&) {}});
  feed(streams, begin, gone, session);
  feed(streams, again, end, session);
  return out;
}

double median(std::vector<double> v) {
  if (v.empty()) return std::nan("");
  std::nth_element(v.begin(), v.begin() + static_cast<std::ptrdiff_t>(v.size() / 2), v.end());
  return v[v.size() / 2];
}

void print_row(const std::string& name, const std::vector<Outcome>& outcomes) {
  int back = 0, wrong = 0;
  std::vector<double> times, moved;
  for (const Outcome& o : outcomes) {
    wrong += o.wrong ? 1 : 0;
    moved.push_back(o.moved_m);
    if (o.back_after_s < 0) continue;
    ++back;
    times.push_back(o.back_after_s);
  }
  std::printf("| %s | %zu | %.2f | %.2f | %d | %d | %.2f | %.2f |\n", name.c_str(), outcomes.size(),
              median(moved), *std::max_element(moved.begin(), moved.end()), back, wrong, median(times),
              times.empty() ? std::nan("") : *std::max_element(times.begin(), times.end()));
  std::fflush(stdout);
}

}  // namespace

Status print_kidnapping(const KidnappingRequest& request) {
  const auto config = configure(request.selection.assignments);
  if (!config) return config.error();
  const auto recordings = select_recordings(request.selection);
  if (!recordings) return recordings.error();
  std::printf(
      "Live sessions that know their pose, without data for %.1f s; %.0f s of data after that, and searches "
      "count as if they took no time.\n\n"
      "| recording | places | moved meanwhile, median m | most | tracking within %.0f mm at the end | ever "
      "wrong | median s until then | longest |\n|---|---|---|---|---|---|---|---|\n",
      request.cut_s, kAfter_s, 1e3 * kBack_m);
  for (const BenchRecording& recording : *recordings) {
    const auto streams = load_streams(recording, *config);
    if (!streams) return streams.error();
    const std::vector<TimedPose>& truth = streams->job.truth;
    const double needed_s = kBefore_s + request.cut_s + kAfter_s + kSpare_s;
    if (streams->imu.empty() || to_seconds(truth.back().t - truth.front().t) < needed_s)
      return Error{recording.name, text("has no IMU or lasts less than ", needed_s, " s"),
                   "name recordings with --only, or cut less"};
    std::vector<Outcome> outcomes(static_cast<std::size_t>(request.seeds));
    ThreadPool pool(request.threads);
    pool.for_chunks(outcomes.size(), 1, [&](std::size_t, std::size_t i, std::size_t) {
      outcomes[i] = kidnap(*streams, request.cut_s, static_cast<unsigned>(1 + i));
    });
    print_row(recording.name, outcomes);
  }
  return {};
}

}  // namespace evpose::experiments
