// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/bench/experiments/variants.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>

#include "evpose/eval/score.h"
#include "evpose/io/files/config_yaml.h"
#include "evpose/run/presets.h"

namespace evpose::experiments {
namespace {

const std::vector<Variant> kBackEnds{
    {"STPE alone", false, {"events.noise_filter.on=false", "registration.polarity=false"}},
    {"STPE with filter and polarity", false, {}},
    {"particle filter", true, {"fusion.kind=particle"}},
    {"EKF (full, the default)", true, {"fusion.kind=ekf"}},
    {"graph", true, {"fusion.kind=graph"}},
    {"EKF, gravity's direction", true, {"fusion.calibration.gravity=true"}},
    {"EKF, offsets of segments", true, {"fusion.segment_offsets=on"}},
};

const std::vector<Variant> kAblation{
    {"all", true, {}},
    {"without noise filter", true, {"events.noise_filter.on=false"}},
    {"without polarity", true, {"registration.polarity=false"}},
    {"polarity without buffer zone", true, {"registration.buffer_sigma=0"}},
    {"with extraction of moving things", true, {"registration.ego_motion_test=true"}},
    {"without edge delay", true, {"registration.edge_delay=false"}},
    {"without occlusion", true, {"visible.occlusion=false"}},
    {"without IMU", false, {}},
    {"temporal field", true, {"registration.kind=temporal_field"}},
    {"temporal field without IMU (STPE)", false, {"registration.kind=temporal_field"}},
    {"temporal field without IMU and noise filter",
     false,
     {"registration.kind=temporal_field", "events.noise_filter.on=false"}},
};

constexpr const char *kFollowingDecay = "temporal_field.eta_s=0", *kSpline = "temporal_field.kernel=spline",
                     *kShortestSupport = "events.noise_filter.support_min_s=0.002",
                     *kLongestSupport = "events.noise_filter.support_max_s=0.03",
                     *kEventsOnce = "registration.kind=events", *kNoDelay = "registration.edge_delay=false";

const std::vector<Variant> kPaper{
    {"paper", true, {}, "paper"},
    {"paper: signs of the map alone", true, {"temporal_field.learn_contrast=false"}, "paper"},
    {"paper: both polarities everywhere", true, {"registration.polarity=false"}, "paper"},
    {"paper: no buffer zone", true, {"registration.buffer_sigma=0"}, "paper"},
    {"paper: no noise filter", true, {"events.noise_filter.on=false"}, "paper"},
    {"paper: no early stage", true, {"events.noise_filter.on=false", "registration.polarity=false"}, "paper"},
    {"paper: eta 30 ms", true, {"temporal_field.eta_s=0.03"}, "paper"},
    {"paper: STPE alone", false, {"events.noise_filter.on=false", "registration.polarity=false"}, "paper"},
    {"paper: STPE and early stage", false, {}, "paper"},
    {"paper: EKF", true, {"fusion.kind=ekf"}, "paper"},
    {"paper: particle filter", true, {"fusion.kind=particle"}, "paper"},
    {"1: decay follows the flow", true, {kFollowingDecay}, "paper"},
    {"2: spline", true, {kFollowingDecay, kSpline}, "paper"},
    {"3: filter follows the flow",
     true,
     {kFollowingDecay, kSpline, kShortestSupport, kLongestSupport},
     "paper"},
    {"4: each event once, gate 1.5 px",
     true,
     {kShortestSupport, kLongestSupport, kEventsOnce, kNoDelay, "registration.gate_px=1.5"},
     "paper"},
    {"5: gate 0.5 px", true, {kShortestSupport, kLongestSupport, kEventsOnce, kNoDelay}, "paper"},
    {"6: edge delay", true, {kShortestSupport, kLongestSupport, kEventsOnce}, "paper"},
    {"7: EKF, the defaults", true, {}},
};

struct Figures {
  Health at_end = Health::waiting;
  TrajectoryScore score;            ///< of the updates
  std::optional<double> jitter_mm;  ///< of the output at the IMU's rate
  std::vector<double> latency_ms, fuse_ms;
  double sideways_mm = 0, tilt_deg = 0;  ///< mean over the last metre of height, of a landing
  int landing = 0;                       ///< updates in it
  double near = 0, wrong_polarity = 0;   ///< events near contours; of these, left out for their polarity
  double read = 0, kept = 0;             ///< events; of these, passed by the noise filter
  int tracking = 0;                      ///< updates
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

/// Gathers what the tracker says while it runs.
class Gathered {
 public:
  Gathered(const std::vector<TimedPose>& truth, Figures& out)
      : truth_(truth), landing_below_(landing_below(truth)), out_(out) {}

  void add(const Update& u) {
    if (landing_below_ && u.t < truth_.back().t) add_landing(u);
    out_.at_end = u.health;
    poses_.push_back({u.t, u.T_map_body});
    fast_poses_.push_back(poses_.back());
    covariances_.push_back(u.covariance);
    velocities_.push_back(u.velocity);
    out_.latency_ms.push_back(1e3 * u.times.after_newest_event_s());
    out_.fuse_ms.push_back(1e3 * u.times.fuse_s);
    out_.near += u.events_matched + u.wrong_polarity;
    out_.wrong_polarity += u.wrong_polarity;
    out_.read += u.events_read;
    out_.kept += u.events_kept;
    out_.tracking += u.health == Health::tracking;
  }
  void add(const FusionState& s) { fast_poses_.push_back({s.t, s.nav.T_map_body}); }
  void score() {
    out_.score = score_trajectory({poses_, truth_, covariances_, velocities_, {}}, {});
    out_.jitter_mm = score_trajectory({fast_poses_, truth_, {}, {}, {}}, {}).jitter_mm;
  }

 private:
  void add_landing(const Update& u) {
    const Pose truth = start_at(truth_, u.t).T_map_body;
    if (truth.p.z() >= *landing_below_) return;
    const Eigen::Vector3d up = u.T_map_body.q * (truth.q.conjugate() * Eigen::Vector3d::UnitZ());
    out_.sideways_mm += 1e3 * (u.T_map_body.p - truth.p).head<2>().norm();
    out_.tilt_deg += 180 / M_PI * std::asin(std::min(1.0, up.head<2>().norm()));
    ++out_.landing;
  }

  const std::vector<TimedPose>& truth_;
  std::optional<double> landing_below_;
  Figures& out_;
  std::vector<TimedPose> poses_, fast_poses_;
  std::vector<Matrix6d> covariances_;
  std::vector<Eigen::Vector3d> velocities_;
};

Expected<Figures> measure(Streams streams, const Variant& variant,
                          const std::vector<std::string>& assignments) {
  ConfigTable table;
  describe(table, streams.job.config);
  if (auto ok = apply_preset(table, variant.preset); !ok) return ok.error();
  for (const auto* list : {&variant.settings, &assignments})
    if (auto ok = apply_assignments(table, *list); !ok) return ok.error();
  if (!variant.imu) streams.job.setup.motion = MotionModel::constant_velocity;
  auto tracker = Tracker::create(streams.job.setup, streams.job.config.tracker, streams.job.start, wall_s);
  if (!tracker) return tracker.error();
  Figures out;
  Gathered gathered(streams.job.truth, out);
  (*tracker)->on_update([&](const Update& u) { gathered.add(u); });
  (*tracker)->on_state([&](const FusionState& s) { gathered.add(s); });
  feed(streams.packets, variant.imu ? streams.imu : std::vector<ImuSample>{}, **tracker);
  gathered.score();
  return out;
}

void print_row(const Variant& variant, const Figures& f) {
  const TrajectoryScore& s = f.score;
  const auto relative = [](const std::optional<RelativeError>& e) { return e.value_or(RelativeError{}); };
  std::printf(
      "| %s | %s | %.1f | %.2f | %.3f | %.1f | %.3f | %.3f | %.2f | %.3f | %.1f | %.2f | %.2f | %.3f | %.2f, "
      "%.3f | %.1f | %.1f | %.2f / %.2f | %.2f / %.2f |\n",
      variant.name, to_string(f.at_end),
      100.0 * f.tracking / std::max<double>(1, static_cast<double>(f.latency_ms.size())), s.ate_mm.mean,
      s.are_deg.mean, s.ate_mm.max, relative(s.over_10ms).translation_mm, relative(s.over_10ms).rotation_deg,
      relative(s.over_100ms).translation_mm, relative(s.over_100ms).rotation_deg,
      s.velocity_rmse_mm_s.value_or(0), s.nees6_mean.value_or(0), s.lag_ms.value_or(0),
      f.jitter_mm.value_or(0), f.sideways_mm / std::max(1, f.landing), f.tilt_deg / std::max(1, f.landing),
      100 * (1 - f.kept / std::max(1.0, f.read)), 100 * f.wrong_polarity / std::max(1.0, f.near),
      share(f.latency_ms, 0.5), share(f.latency_ms, 0.99), share(f.fuse_ms, 0.5), share(f.fuse_ms, 0.99));
  std::fflush(stdout);
}

Status print_recording(const BenchRecording& recording, const std::vector<Variant>& variants,
                       const VariantsRequest& request) {
  const auto streams = load_streams(recording, RunConfig{});
  if (!streams) return streams.error();
  std::printf(
      "\n### %s\n\n| variant | at the end | tracked %% | ATE mean mm | ARE mean deg | ATE max mm | RTE 10 ms "
      "mm "
      "| RRE 10 ms deg | RTE 100 ms mm | RRE 100 ms deg | velocity mm/s | NEES/6 | lag ms | jitter mm "
      "| landing: sideways mm, tilt deg | noise %% | wrong polarity %% | update p50 / p99 ms | fusion p50 / "
      "p99 ms |\n"
      "|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n",
      recording.name.c_str());
  for (const Variant& variant : variants) {
    const auto wanted = [&](const std::string& begin) {
      return std::string(variant.name).starts_with(begin);
    };
    if (!request.begins.empty() && std::none_of(request.begins.begin(), request.begins.end(), wanted))
      continue;
    const auto figures = measure(*streams, variant, request.selection.assignments);
    if (!figures) return figures.error();
    print_row(variant, *figures);
  }
  return {};
}

}  // namespace

const std::vector<Variant>& back_end_variants() { return kBackEnds; }
const std::vector<Variant>& ablation_variants() { return kAblation; }
const std::vector<Variant>& paper_variants() { return kPaper; }

Status print_variants(const std::vector<Variant>& variants, const VariantsRequest& request) {
  if (!request.own.folder.empty()) return print_recording(request.own, variants, request);
  const auto recordings = select_recordings(request.selection);
  if (!recordings) return recordings.error();
  for (const BenchRecording& recording : *recordings)
    if (auto ok = print_recording(recording, variants, request); !ok) return ok;
  return {};
}

}  // namespace evpose::experiments
