// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/bench/experiments/relocalization.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <random>

#include "evpose/core/parallel.h"

namespace evpose::experiments {
namespace {

constexpr double kWithin_s = 0.5, kLocked_m = 0.01;
constexpr double kUnknownSpeed_m_s = 0.5, kUnknownRate_rad_s = 0.5;  // 1 sigma of a start at rest

/// How far off a start is, in a random direction.
struct StartClass {
  const char* name;
  double position_m, rotation_deg;
};
constexpr std::array<StartClass, 3> kClasses{
    {{"5 cm, 0.5 deg", 0.05, 0.5}, {"10 cm, 2 deg", 0.1, 2}, {"30 cm, 5 deg", 0.3, 5}}};

struct StartOutcome {
  bool tracking = false;
  double error_mm = 0, found_after_s = -1;
};

double uniform(std::mt19937& random) { return (static_cast<double>(random()) + 0.5) / 4294967296.0; }

Eigen::Vector3d direction(std::mt19937& random) {
  const double z = 2 * uniform(random) - 1, a = 2 * M_PI * uniform(random), r = std::sqrt(1 - z * z);
  return {r * std::cos(a), r * std::sin(a), z};
}

/// A time at which half a second of the recording is left.
TimeNs random_begin(const std::vector<TimedPose>& truth, std::mt19937& random) {
  const TimeNs first = truth.front().t + 10 * kNsPerMs;
  const double slack_s = to_seconds(truth.back().t - first) - kWithin_s - 0.05;
  return first + from_seconds(uniform(random) * std::max(1e-3, slack_s));
}

/// The true pose with an error of that class; neither velocity nor rate is known.
StartState wrong_start(const std::vector<TimedPose>& truth, TimeNs t, const StartClass& from,
                       std::mt19937& random) {
  StartState state = start_at(truth, t);
  Vector6d error;
  error.head<3>() = from.position_m * direction(random);
  error.tail<3>() = from.rotation_deg * M_PI / 180 * direction(random);
  state.T_map_body = state.T_map_body.plus(error);
  state.velocity.setZero();
  state.angular_rate_body.setZero();
  return state;
}

TrackerConfig unsure_of_start(TrackerConfig config, const StartClass& from) {
  config.fusion.start_position_sigma_m = from.position_m / std::sqrt(3);
  config.fusion.start_rotation_sigma_rad = from.rotation_deg * M_PI / 180 / std::sqrt(3);
  config.fusion.start_velocity_sigma_m_s = kUnknownSpeed_m_s;
  config.fusion.start_angular_rate_sigma_rad_s = kUnknownRate_rad_s;
  return config;
}

StartOutcome start(const Streams& streams, const StartClass& from, unsigned seed) {
  std::mt19937 random(seed);
  const std::vector<TimedPose>& truth = streams.job.truth;
  const TimeNs begin = random_begin(truth, random);
  const TimeNs end = begin + from_seconds(kWithin_s + 0.01);
  const auto [packets, imu] = excerpt(streams, begin, end);
  const StartState state = wrong_start(truth, begin, from, random);
  StartOutcome out;
  auto tracker = Tracker::create(streams.job.setup, unsure_of_start(streams.job.config.tracker, from), state);
  if (!tracker) return out;
  (*tracker)->on_update([&](const Update& u) {
    if (u.t > begin + from_seconds(kWithin_s)) return;
    out.tracking = u.health == Health::tracking || u.health == Health::degraded;
    out.error_mm = 1e3 * u.T_map_body.minus(start_at(truth, u.t).T_map_body).head<3>().norm();
    const bool locked = out.tracking && out.error_mm < 1e3 * kLocked_m;
    if (!locked) out.found_after_s = -1;
    if (locked && out.found_after_s < 0) out.found_after_s = to_seconds(u.t - begin);
  });
  feed(packets, imu, **tracker);
  (*tracker)->events_complete_until(end);
  return out;
}

std::vector<StartOutcome> start_all(const Streams& streams, const StartClass& from,
                                    const RelocalizationRequest& request) {
  std::vector<StartOutcome> outcomes(static_cast<std::size_t>(request.seeds));
  ThreadPool pool(request.threads);
  pool.for_chunks(outcomes.size(), 1, [&](std::size_t, std::size_t i, std::size_t) {
    outcomes[i] = start(streams, from, static_cast<unsigned>(1 + i));
  });
  return outcomes;
}

double median(std::vector<double> v) {
  if (v.empty()) return std::nan("");
  std::nth_element(v.begin(), v.begin() + static_cast<std::ptrdiff_t>(v.size() / 2), v.end());
  return v[v.size() / 2];
}

void print_row(const std::string& name, const StartClass& from, const std::vector<StartOutcome>& outcomes) {
  int locked = 0, wrong = 0;
  std::vector<double> times, errors;
  for (const StartOutcome& o : outcomes) {
    if (o.found_after_s >= 0) {
      ++locked;
      times.push_back(o.found_after_s);
      errors.push_back(o.error_mm);
    } else if (o.tracking) {
      ++wrong;
    }
  }
  std::printf("| %s | %s | %d | %d | %d | %.2f | %.1f |\n", name.c_str(), from.name, locked, wrong,
              static_cast<int>(outcomes.size()) - locked - wrong, median(times), median(errors));
  std::fflush(stdout);
}

}  // namespace

Status print_relocalization(const RelocalizationRequest& request) {
  const auto config = configure(request.selection.assignments);
  if (!config) return config.error();
  const auto recordings = select_recordings(request.selection);
  if (!recordings) return recordings.error();
  std::printf(
      "%d starts each, anywhere in the recording, velocity unknown%s. Locked: within %.0f mm after %.1f "
      "s.\n\n"
      "| recording | start off by | locked | wrong pose called tracking | not initialised | median s to lock "
      "| median error mm |\n|---|---|---|---|---|---|---|\n",
      request.seeds, request.imu ? "" : ", no IMU", 1e3 * kLocked_m, kWithin_s);
  for (const BenchRecording& recording : *recordings) {
    auto streams = load_streams(recording, *config);
    if (!streams) return streams.error();
    if (!request.imu) {
      streams->imu.clear();
      streams->job.setup.motion = MotionModel::constant_velocity;
    }
    for (const StartClass& from : kClasses)
      print_row(recording.name, from, start_all(*streams, from, request));
  }
  return {};
}

}  // namespace evpose::experiments
