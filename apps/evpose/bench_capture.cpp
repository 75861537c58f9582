// SPDX-License-Identifier: BSD-3-Clause
// Starts from poor poses anywhere in the shared recordings: is the pose found, how soon, and is a wrong one
// ever called tracking?
#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <memory>
#include <random>

#include "bench.h"
#include "bench_streams.h"
#include "commands.h"
#include "evpose/core/parallel.h"
#include "evpose/io/files/config_yaml.h"

namespace evpose {
namespace {

constexpr double kWithin_s = 0.5, kLocked_m = 0.01;

struct StartClass {
  const char* name;
  double position_m, rotation_deg;
};
constexpr std::array<StartClass, 3> kClasses{
    {{"5 cm, 0.5 deg", 0.05, 0.5}, {"10 cm, 2 deg", 0.1, 2}, {"30 cm, 5 deg", 0.3, 5}}};

struct CaptureRequest {
  std::string folder = "../shared/data/peer", only;
  int seeds = 20, threads = 2;
  bool imu = true;
  std::vector<std::string> assignments;
};

struct Outcome {
  bool tracking = false;
  double error_mm = 0, found_after_s = -1;
};

Outcome start(const Streams& streams, const StartClass& from, unsigned seed) {
  std::mt19937 random(seed);
  const auto uniform = [&random] { return (static_cast<double>(random()) + 0.5) / 4294967296.0; };
  const auto direction = [&] {
    const double z = 2 * uniform() - 1, a = 2 * M_PI * uniform(), r = std::sqrt(1 - z * z);
    return Eigen::Vector3d(r * std::cos(a), r * std::sin(a), z);
  };
  const std::vector<TimedPose>& truth = streams.job.truth;
  const TimeNs first = truth.front().t + 10 * kNsPerMs;
  const double slack_s = to_seconds(truth.back().t - first) - kWithin_s - 0.05;
  const TimeNs begin = first + from_seconds(uniform() * std::max(1e-3, slack_s));
  const TimeNs end = begin + from_seconds(kWithin_s + 0.01);
  const auto [packets, imu] = excerpt(streams, begin, end);

  // Neither velocity nor rate is known.
  StartState state = start_at(truth, begin);
  Vector6d error;
  error << from.position_m * direction(), from.rotation_deg * M_PI / 180 * direction();
  state.T_map_body = state.T_map_body.plus(error);
  state.velocity.setZero();
  state.angular_rate_body.setZero();
  TrackerConfig config = streams.job.config.tracker;
  config.fusion.start_position_sigma_m = from.position_m / std::sqrt(3);
  config.fusion.start_rotation_sigma_rad = from.rotation_deg * M_PI / 180 / std::sqrt(3);
  config.fusion.start_velocity_sigma_m_s = 0.5;
  config.fusion.start_angular_rate_sigma_rad_s = 0.5;
  Outcome out;
  auto tracker = Tracker::create(streams.job.setup, config, state);
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

double median(std::vector<double> v) {
  if (v.empty()) return std::nan("");
  std::nth_element(v.begin(), v.begin() + static_cast<std::ptrdiff_t>(v.size() / 2), v.end());
  return v[v.size() / 2];
}

int bench_capture(const CaptureRequest& request) {
  RunConfig config;
  ConfigTable table;
  describe(table, config);
  for (const auto& assignment : request.assignments)
    if (auto ok = apply_assignment(table, assignment); !ok) return bad_input(ok.error());
  std::printf("Made by `evpose bench capture`; do not edit.\n\n");
  std::printf(
      "%d starts each, anywhere in the recording, velocity unknown%s. Locked: within %.0f mm after %.1f "
      "s.\n\n",
      request.seeds, request.imu ? "" : ", no IMU", 1e3 * kLocked_m, kWithin_s);
  std::printf(
      "| recording | start off by | locked | wrong pose called tracking | not initialised | median s to lock "
      "| "
      "median error mm |\n|---|---|---|---|---|---|---|\n");
  for (const PeerRecording& peer : peer_recordings(request.folder)) {
    if (!request.only.empty() && peer.name != request.only) continue;
    TrackRequest track;
    track.recording = peer.folder;
    track.map = peer.map;
    track.occluders = peer.occluders;
    auto streams = load_streams(track, config);
    if (!streams) return bad_input(streams.error());
    if (!request.imu) {
      streams->imu.clear();
      streams->job.setup.motion = MotionModel::constant_velocity;
    }
    for (const StartClass& from : kClasses) {
      std::vector<Outcome> outcomes(static_cast<std::size_t>(request.seeds));
      ThreadPool pool(request.threads);
      pool.for_chunks(outcomes.size(), 1, [&](std::size_t, std::size_t i, std::size_t) {
        outcomes[i] = start(*streams, from, static_cast<unsigned>(1 + i));
      });
      int locked = 0, wrong = 0;
      std::vector<double> times, errors;
      for (const Outcome& o : outcomes) {
        if (o.found_after_s >= 0) {
          ++locked;
          times.push_back(o.found_after_s);
          errors.push_back(o.error_mm);
        } else if (o.tracking) {
          ++wrong;
        }
      }
      std::printf("| %s | %s | %d | %d | %d | %.2f | %.1f |\n", peer.name.c_str(), from.name, locked, wrong,
                  request.seeds - locked - wrong, median(times), median(errors));
      std::fflush(stdout);
    }
  }
  return 0;
}

}  // namespace

void add_bench_capture(CLI::App& bench, std::function<int()>& run) {
  auto* command = bench.add_subcommand("capture", "Starts from poor poses");
  auto request = std::make_shared<CaptureRequest>();
  command->add_option("folder", request->folder, "folder with the recordings and maps")
      ->capture_default_str();
  command->add_option("--recording", request->only, "one recording alone, by name");
  command->add_option("--seeds", request->seeds, "starts for each recording and class")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
  command->add_option("--threads", request->threads, "starts at a time")
      ->check(CLI::Range(1, 64))
      ->capture_default_str();
  command->add_flag("!--no-imu", request->imu, "leave the IMU out");
  command->add_option("--set", request->assignments, "one setting, key=value")->allow_extra_args(false);
  command->callback([=, &run] { run = [=] { return bench_capture(*request); }; });
}

}  // namespace evpose
