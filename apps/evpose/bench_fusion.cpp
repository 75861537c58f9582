// SPDX-License-Identifier: BSD-3-Clause
// Variants of the tracker side by side: the back ends (docs/results/fusion.md), and what each module brings
// (docs/results/ablation.md).
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <memory>
#include <optional>

#include "bench.h"
#include "bench_streams.h"
#include "commands.h"
#include "evpose/eval/score.h"
#include "evpose/io/files/config_yaml.h"

namespace evpose {
namespace {

struct Variant {
  const char* name;
  bool imu;
  std::vector<std::string> settings;
};

const std::vector<Variant> kBackEnds{
    {"STPE alone", false, {"events.filter.on=false", "alignment.polarity=false"}},
    {"... with filter and polarity", false, {}},
    {"particle filter", true, {"fusion.kind=particle"}},
    {"EKF (full, the default)", true, {"fusion.kind=ekf"}},
    {"graph", true, {"fusion.kind=graph"}},
    {"graph, tight", true, {"fusion.kind=graph", "fusion.coupling=tight"}},
    {"graph, tight, in the background",
     true,
     {"fusion.kind=graph", "fusion.coupling=tight", "fusion.window.background=true"}},
    {"EKF, gravity's direction", true, {"fusion.slow.gravity=true"}},
    {"EKF, lasting offset", true, {"fusion.slow.pose_offset=true", "alignment.shared_s=0"}},
    {"EKF, offsets of pieces", true, {"fusion.slow.piece_offset=on"}},
};

const std::vector<Variant> kAblation{
    {"all", true, {}},
    {"without noise filter", true, {"events.filter.on=false"}},
    {"without polarity", true, {"alignment.polarity=false"}},
    {"polarity without buffer zone", true, {"alignment.buffer_sigma=0"}},
    {"with extraction of moving things", true, {"alignment.flow.on=true"}},
    {"without lateness", true, {"alignment.lateness=false"}},
    {"without honest slope", true, {"alignment.honest_slope=false"}},
    {"gate opened by the prediction's sigma", true, {"alignment.widest_gate_px=6"}},
    {"without ambiguity exclusion", true, {"alignment.ambiguity_px=0"}},
    {"without occlusion", true, {"visible.occlusion=false"}},
    {"without IMU", false, {}},
    {"eq. (1), the exponential field", true, {"field=exponential"}},
    {"... and without IMU (STPE)", false, {"field=exponential"}},
    {"... and without noise filter", false, {"field=exponential", "events.filter.on=false"}},
};

struct VariantsRequest {
  const char* name;
  const std::vector<Variant>& variants;
  std::string folder = "../shared/data/peer";
  std::vector<std::string> only, begins, assignments;
  TrackRequest own;  ///< a recording to take instead of the folder's
};

struct Figures {
  Health at_end = Health::waiting;
  TrajectoryScore score;            ///< of the updates
  std::optional<double> jitter_mm;  ///< of the output at the IMU's rate
  std::vector<double> latency_ms, fuse_ms;
  double sideways_mm = 0, tilt_deg = 0;  ///< mean over the last metre of height, of a landing
  int landing = 0;                       ///< updates in it
  double near = 0, wrong_polarity = 0;   ///< events near contours; of these, left out for their polarity
};

/// A recording that ends lower than a metre below its highest point: the height from which on it lands.
std::optional<double> landing_below(const std::vector<TimedPose>& truth) {
  double highest = truth.front().pose.p.z();
  for (const TimedPose& p : truth) highest = std::max(highest, p.pose.p.z());
  const double end = truth.back().pose.p.z();
  return highest > end + 1 ? std::optional<double>(end + 1) : std::nullopt;
}

double share(std::vector<double> values, double at) {
  std::sort(values.begin(), values.end());
  return values.empty() ? 0 : quantile(values, at);
}

Expected<Figures> measure(Streams streams, const Variant& variant, const VariantsRequest& request) {
  ConfigTable table;
  describe(table, streams.job.config);
  for (const auto* list : {&variant.settings, &request.assignments})
    for (const auto& assignment : *list)
      if (auto ok = apply_assignment(table, assignment); !ok) return ok.error();
  if (!variant.imu) streams.job.setup.motion = MotionModel::constant_velocity;
  auto tracker = Tracker::create(streams.job.setup, streams.job.config.tracker, streams.job.start, wall_s);
  if (!tracker) return tracker.error();

  Figures out;
  std::vector<TimedPose> poses, fast_poses;
  std::vector<Matrix6d> covariances;
  std::vector<Eigen::Vector3d> velocities;
  const std::optional<double> landing = landing_below(streams.job.truth);
  (*tracker)->on_update([&](const Update& u) {
    if (landing && u.t < streams.job.truth.back().t) {
      const Pose truth = start_at(streams.job.truth, u.t).T_map_body;
      if (truth.p.z() < *landing) {
        const Eigen::Vector3d up = u.T_map_body.q * (truth.q.conjugate() * Eigen::Vector3d::UnitZ());
        out.sideways_mm += 1e3 * (u.T_map_body.p - truth.p).head<2>().norm();
        out.tilt_deg += 180 / M_PI * std::asin(std::min(1.0, up.head<2>().norm()));
        ++out.landing;
      }
    }
    out.at_end = u.health;
    poses.push_back({u.t, u.T_map_body});
    fast_poses.push_back(poses.back());
    covariances.push_back(u.covariance);
    velocities.push_back(u.velocity);
    out.latency_ms.push_back(1e3 * u.times.after_newest_event_s());
    out.fuse_ms.push_back(1e3 * u.times.fuse_s);
    out.near += u.events_matched + u.wrong_polarity;
    out.wrong_polarity += u.wrong_polarity;
  });
  (*tracker)->on_state([&](const FusionState& s) { fast_poses.push_back({s.t, s.nav.T_map_body}); });
  feed(streams.packets, variant.imu ? streams.imu : std::vector<ImuSample>{}, **tracker);
  out.score = score_trajectory({poses, streams.job.truth, covariances, velocities, {}}, {});
  out.jitter_mm = score_trajectory({fast_poses, streams.job.truth, {}, {}, {}}, {}).jitter_mm;
  return out;
}

void print_row(const Variant& variant, const Figures& f) {
  const TrajectoryScore& s = f.score;
  const auto relative = [](const std::optional<RelativeError>& e) { return e.value_or(RelativeError{}); };
  std::printf(
      "| %s | %s | %.2f | %.3f | %.1f | %.3f | %.3f | %.2f | %.3f | %.1f | %.2f | %.2f | %.3f | %.2f, %.3f | "
      "%.1f | %.2f "
      "/ "
      "%.2f | %.2f / %.2f |\n",
      variant.name, to_string(f.at_end), s.ate_mm.mean, s.are_deg.mean, s.ate_mm.max,
      relative(s.over_10ms).translation_mm, relative(s.over_10ms).rotation_deg,
      relative(s.over_100ms).translation_mm, relative(s.over_100ms).rotation_deg,
      s.velocity_rmse_mm_s.value_or(0), s.nees6_mean.value_or(0), s.lag_ms.value_or(0),
      f.jitter_mm.value_or(0), f.sideways_mm / std::max(1, f.landing), f.tilt_deg / std::max(1, f.landing),
      100 * f.wrong_polarity / std::max(1.0, f.near), share(f.latency_ms, 0.5), share(f.latency_ms, 0.99),
      share(f.fuse_ms, 0.5), share(f.fuse_ms, 0.99));
  std::fflush(stdout);
}

int bench_recording(const std::string& name, const TrackRequest& track, const VariantsRequest& request) {
  const auto streams = load_streams(track, RunConfig{});
  if (!streams) return bad_input(streams.error());
  std::printf(
      "\n### %s\n\n| variant | at the end | ATE mean mm | ARE mean deg | ATE max mm | RTE 10 ms mm | RRE 10 "
      "ms deg "
      "| RTE 100 ms mm | RRE 100 ms deg | velocity mm/s | NEES/6 | lag ms | jitter mm | landing: sideways "
      "mm, tilt deg | wrong polarity %% "
      "| update p50 / p99 ms | fusion p50 / p99 ms |\n"
      "|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n",
      name.c_str());
  for (const Variant& variant : request.variants) {
    const auto wanted = [&](const std::string& begin) {
      return std::string(variant.name).starts_with(begin);
    };
    if (!request.begins.empty() && std::none_of(request.begins.begin(), request.begins.end(), wanted))
      continue;
    const auto figures = measure(*streams, variant, request);
    if (!figures) return bad_input(figures.error());
    print_row(variant, *figures);
  }
  return 0;
}

int bench_variants(const VariantsRequest& request) {
  std::printf("Made by `evpose bench %s`; do not edit. Latency is that of the machine it ran on.\n",
              request.name);
  if (!request.own.recording.empty()) return bench_recording(request.own.recording, request.own, request);
  for (const PeerRecording& peer : peer_recordings(request.folder)) {
    if (!request.only.empty() &&
        std::find(request.only.begin(), request.only.end(), peer.name) == request.only.end())
      continue;
    TrackRequest track;
    track.recording = peer.folder;
    track.map = peer.map;
    track.occluders = peer.occluders;
    if (const int status = bench_recording(peer.name, track, request); status != 0) return status;
  }
  return 0;
}

void add_bench_variants(CLI::App& bench, std::function<int()>& run, const char* name, const char* what,
                        const std::vector<Variant>& variants) {
  auto* command = bench.add_subcommand(name, what);
  auto request = std::make_shared<VariantsRequest>(
      VariantsRequest{name, variants, "../shared/data/peer", {}, {}, {}, {}});
  command->add_option("folder", request->folder, "folder with the recordings and maps")
      ->capture_default_str();
  command->add_option("--only", request->only, "names of recordings")->delimiter(',');
  command->add_option("--variant", request->begins, "how the names of variants begin that are wanted")
      ->delimiter(',');
  auto* own = command->add_option("--recording", request->own.recording,
                                  "a recording with truth, instead of the folder's");
  own->needs(command->add_option("--map", request->own.map, "... and its map"));
  command->add_option("--occluders", request->own.occluders, "... and a mesh that hides contours")
      ->needs(own);
  command->add_option("--set", request->assignments, "one setting, key=value, for all")
      ->allow_extra_args(false);
  command->callback([=, &run] { run = [=] { return bench_variants(*request); }; });
}

}  // namespace

void add_bench_fusion(CLI::App& bench, std::function<int()>& run) {
  add_bench_variants(bench, run, "fusion", "Back ends side by side", kBackEnds);
  add_bench_variants(bench, run, "ablation", "What each module of the tracker brings", kAblation);
}

}  // namespace evpose
