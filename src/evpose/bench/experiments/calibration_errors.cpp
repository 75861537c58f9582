// SPDX-License-Identifier: BSD-3-Clause
// The pose with a calibration that is wrong by known amounts, as given and with its errors as states.
#include <algorithm>
#include <cstdio>
#include <limits>
#include <string>
#include <vector>

#include "evpose/bench/experiments/calibration.h"
#include "evpose/bench/experiments/unseen/tracked_run.h"
#include "evpose/sim/recording/handed_over.h"

namespace evpose::experiments {
namespace {

constexpr double kDegree = M_PI / 180;
constexpr TimeNs kJudgedAfter = 300 * kNsPerMs;

/// What is added to a true calibration.
struct GivenWrong {
  std::string words;
  double focal = 0;  ///< relative
  Eigen::Vector2d centre_px = {0, 0};
  double k1 = 0, k2 = 0, p1 = 0, p2 = 0;
  Eigen::Vector3d turn_deg = {0, 0, 0}, shift_mm = {0, 0, 0};  ///< of the camera in the body
  double time_ms = 0;
};

const GivenWrong kGivenWrong[] = {{"nothing"},
                                  {"focal length +0.3 %", 0.003},
                                  {"principal point (+1, -1) px", 0, {1, -1}},
                                  {"k1 +0.01", 0, {0, 0}, 0.01},
                                  {.words = "camera turned by 0.3 deg", .turn_deg = {0.17, -0.17, 0.17}},
                                  {.words = "camera shifted by 10 mm", .shift_mm = {5.8, -5.8, 5.8}},
                                  {.words = "IMU's clock by 2 ms", .time_ms = 2},
                                  {"0.2 %, 0.5 px, 0.004, 0.2 deg, 5 mm, 1 ms together",
                                   0.002,
                                   {0.5, -0.5},
                                   0.004,
                                   0,
                                   0,
                                   0,
                                   {0.115, -0.115, 0.115},
                                   {2.9, -2.9, 2.9},
                                   1}};

/// All errors of an ordinary calibration together.
GivenWrong drawn(int seed) {
  sim::HandedOverConfig config;
  config.preset = sim::CalibrationQuality::ordinary;
  const sim::CalibrationErrors e = sim::draw_calibration_errors(config, static_cast<std::uint64_t>(seed));
  return {text("draw ", seed),
          e.focal,
          {e.centre_px[0], e.centre_px[1]},
          e.distortion[0],
          e.distortion[1],
          e.distortion[2],
          e.distortion[3],
          e.rotation_rad / kDegree,
          1e3 * e.translation_m,
          1e3 * e.time_s};
}

Status spoil(const GivenWrong& wrong, Streams& streams) {
  for (ImuSample& s : streams.imu) s.t += from_seconds(1e-3 * wrong.time_ms);
  TrackerSetup& setup = streams.job.setup;
  setup.T_body_cam.q = so3::exp(wrong.turn_deg * kDegree) * setup.T_body_cam.q;
  setup.T_body_cam.p += 1e-3 * wrong.shift_mm;
  CameraIntrinsics& numbers = *setup.intrinsics;
  numbers.fx *= 1 + wrong.focal;
  numbers.fy *= 1 + wrong.focal;
  numbers.cx += wrong.centre_px.x();
  numbers.cy += wrong.centre_px.y();
  const double distortion[] = {wrong.k1, wrong.k2, wrong.p1, wrong.p2};
  for (std::size_t i = 0; i < std::min<std::size_t>(4, numbers.distortion.size()); ++i)
    numbers.distortion[i] += distortion[i];
  auto camera = make_camera(numbers);
  if (!camera) return camera.error();
  setup.camera = *camera;
  return {};
}

/// What the pose of the body is worth, and how far the camera is off on average.
struct CalibratedPart {
  unseen::RunFigures body;
  double camera_mm = 0;
};
struct CalibratedRun {
  CalibratedPart whole;
  std::vector<CalibratedPart> by_second;  ///< of data, the first from when it is judged
};

/// A pose, and how far the camera is off with what is known of the calibration by then.
struct CalibratedPose {
  unseen::TrackedPose body;
  double camera_mm;
};

CalibratedPart judged(const std::vector<CalibratedPose>& all, const std::vector<TimedPose>& truth,
                      TimeNs from, TimeNs to) {
  CalibratedPart out;
  std::vector<unseen::TrackedPose> poses;
  for (const CalibratedPose& p : all) {
    if (p.body.pose.t < from || p.body.pose.t >= to) continue;
    poses.push_back(p.body);
    out.camera_mm += (p.camera_mm - out.camera_mm) / static_cast<double>(poses.size());
  }
  out.body = unseen::judge(poses, truth, from).figures;
  return out;
}

/// `stated`: the tracker is told that the calibration is an ordinary one; else that it is known.
Expected<CalibratedRun> tracked(const Streams& streams, const Pose& true_T_body_cam, bool stated) {
  TrackerSetup setup = streams.job.setup;
  if (stated) setup.calibration_sigma = CalibrationSigma{};
  auto tracker = Tracker::create(setup, streams.job.config.tracker, streams.job.start);
  if (!tracker) return tracker.error();
  std::vector<CalibratedPose> poses;
  (*tracker)->on_update([&](const Update& u) {
    const Pose truth = true_pose(streams.job.truth, u.t);
    const Calibration found = (*tracker)->calibration();
    const Pose T_body_cam{found.turn * setup.T_body_cam.q, setup.T_body_cam.p + found.shift};
    const Eigen::Vector3d off = (u.T_map_body * T_body_cam).p - (truth * true_T_body_cam).p;
    poses.push_back({{{u.t, u.T_map_body}, u.covariance, u.health}, 1e3 * off.norm()});
  });
  feed(streams.packets, streams.imu, **tracker);
  const TimeNs start = streams.job.start.t, from = start + kJudgedAfter;
  CalibratedRun out{judged(poses, streams.job.truth, from, std::numeric_limits<TimeNs>::max()), {}};
  for (TimeNs t = start; !poses.empty() && t + kNsPerS <= poses.back().body.pose.t + kNsPerS / 10;
       t += kNsPerS)
    out.by_second.push_back(judged(poses, streams.job.truth, std::max(t, from), t + kNsPerS));
  return out;
}

void print_cells(const CalibratedPart& run) {
  const unseen::RunFigures& f = run.body;
  if (!f.fault.empty())
    std::printf(" %s | - | - | - | %.0f | - |", f.fault.c_str(), 100 * f.tracking);
  else
    std::printf(" %.2f | %.2f | %.3f | %.1f | %.0f | %.0f |", run.camera_mm, f.ate_mm, f.are_deg, f.nees6,
                100 * f.tracking, 100.0 * f.silent / std::max(1, f.poses));
}

/// A row of the other table.
struct SecondRow {
  std::string recording, words;
  std::size_t second;
  CalibratedPart told;
};

Status print_row(const Streams& streams, const std::string& name, const GivenWrong& wrong,
                 std::vector<SecondRow>& by_second) {
  Streams spoilt = streams;
  if (auto ok = spoil(wrong, spoilt); !ok) return ok.error();
  std::printf("| %s | %s |", name.c_str(), wrong.words.c_str());
  for (const bool stated : {false, true}) {
    const auto run = tracked(spoilt, streams.job.setup.T_body_cam, stated);
    if (!run) return run.error();
    print_cells(run->whole);
    for (std::size_t k = 0; stated && k < run->by_second.size(); ++k)
      by_second.push_back({name, wrong.words, k, run->by_second[k]});
  }
  std::printf("\n");
  std::fflush(stdout);
  return {};
}

}  // namespace

Status print_calibration_errors(const Selection& selection, int draws) {
  const auto config = configure(selection.assignments);
  if (!config) return config.error();
  const auto recordings = select_recordings(selection);
  if (!recordings) return recordings.error();
  std::printf(
      "| recording | given wrong | camera mm | body mm | ARE deg | NEES/6 | tracking %% | silently wrong %% "
      "| told: camera mm | told: body mm | told: ARE deg | told: NEES/6 | told: tracking %% | told: silently "
      "wrong %% |\n"
      "|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n");
  std::vector<SecondRow> by_second;
  for (const BenchRecording& recording : *recordings) {
    const auto streams = load_streams(recording, *config);
    if (!streams) return streams.error();
    for (const GivenWrong& wrong : kGivenWrong)
      if (auto ok = print_row(*streams, recording.name, wrong, by_second); !ok) return ok;
    for (int draw = 1; draw <= draws; ++draw)
      if (auto ok = print_row(*streams, recording.name, drawn(draw), by_second); !ok) return ok;
  }
  std::printf(
      "\n## Told, by second of data\n\n| recording | given wrong | second | camera mm | NEES/6 | tracking %% "
      "|\n"
      "|---|---|---|---|---|---|\n");
  for (const auto& [recording, words, second, told] : by_second)
    if (told.body.fault.empty())
      std::printf("| %s | %s | %zu | %.2f | %.3f | %.0f |\n", recording.c_str(), words.c_str(), second,
                  told.camera_mm, told.body.nees6, 100 * told.body.tracking);
  return {};
}

}  // namespace evpose::experiments
