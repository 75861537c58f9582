// SPDX-License-Identifier: BSD-3-Clause
// The pose with a calibration that is wrong by known amounts, as given and with its errors as states.
#include <cstdio>
#include <string>
#include <vector>

#include "evpose/bench/experiments/calibration.h"
#include "evpose/bench/experiments/unseen/tracked_run.h"

namespace evpose::experiments {
namespace {

constexpr double kDegree = M_PI / 180;
constexpr TimeNs kJudgedAfter = 300 * kNsPerMs;

/// What is added to a true calibration.
struct GivenWrong {
  const char* words;
  double focal = 0;  ///< relative
  Eigen::Vector2d centre_px = {0, 0};
  double k1 = 0;
  Eigen::Vector3d turn_deg = {0, 0, 0}, shift_mm = {0, 0, 0};  ///< of the camera in the body
  double time_ms = 0;
};

const GivenWrong kGivenWrong[] = {{"nothing"},
                                  {"focal length +0.3 %", 0.003},
                                  {"principal point (+1, -1) px", 0, {1, -1}},
                                  {"k1 +0.01", 0, {0, 0}, 0.01},
                                  {"camera turned by 0.3 deg", 0, {0, 0}, 0, {0.17, -0.17, 0.17}},
                                  {"camera shifted by 10 mm", 0, {0, 0}, 0, {0, 0, 0}, {5.8, -5.8, 5.8}},
                                  {"IMU's clock by 2 ms", 0, {0, 0}, 0, {0, 0, 0}, {0, 0, 0}, 2},
                                  {"0.2 %, 0.5 px, 0.004, 0.2 deg, 5 mm, 1 ms together",
                                   0.002,
                                   {0.5, -0.5},
                                   0.004,
                                   {0.115, -0.115, 0.115},
                                   {2.9, -2.9, 2.9},
                                   1}};

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
  if (!numbers.distortion.empty()) numbers.distortion[0] += wrong.k1;
  auto camera = make_camera(numbers);
  if (!camera) return camera.error();
  setup.camera = *camera;
  return {};
}

/// With the sigmas that `fusion.calibration.*` sets out from.
CalibrationConfig all_states() {
  CalibrationConfig c;
  c.time_offset = c.rotation = c.translation = c.intrinsics = true;
  return c;
}

Expected<unseen::RunFigures> figures(const Streams& streams, bool as_states) {
  TrackerConfig config = streams.job.config.tracker;
  if (as_states) config.fusion.calibration = all_states();
  auto tracker = Tracker::create(streams.job.setup, config, streams.job.start);
  if (!tracker) return tracker.error();
  std::vector<unseen::TrackedPose> poses;
  (*tracker)->on_update([&](const Update& u) {
    poses.push_back({{u.t, u.T_map_body}, u.covariance, u.health});
  });
  feed(streams.packets, streams.imu, **tracker);
  return unseen::judge(poses, streams.job.truth, streams.job.start.t + kJudgedAfter).figures;
}

void print_cells(const unseen::RunFigures& f) {
  if (!f.fault.empty())
    std::printf(" %s | - | - | %.0f | - |", f.fault.c_str(), 100 * f.tracking);
  else
    std::printf(" %.2f | %.3f | %.1f | %.0f | %.0f |", f.ate_mm, f.are_deg, f.nees6, 100 * f.tracking,
                100.0 * f.silent / std::max(1, f.poses));
}

}  // namespace

Status print_calibration_errors(const Selection& selection) {
  const auto config = configure(selection.assignments);
  if (!config) return config.error();
  const auto recordings = select_recordings(selection);
  if (!recordings) return recordings.error();
  std::printf(
      "| recording | given wrong | ATE mm | ARE deg | NEES/6 | tracking %% | silently wrong %% "
      "| as states: ATE mm | ARE deg | NEES/6 | tracking %% | silently wrong %% |\n"
      "|---|---|---|---|---|---|---|---|---|---|---|---|\n");
  for (const BenchRecording& recording : *recordings) {
    const auto streams = load_streams(recording, *config);
    if (!streams) return streams.error();
    for (const GivenWrong& wrong : kGivenWrong) {
      Streams spoilt = *streams;
      if (auto ok = spoil(wrong, spoilt); !ok) return ok.error();
      std::printf("| %s | %s |", recording.name.c_str(), wrong.words);
      for (const bool as_states : {false, true}) {
        const auto found = figures(spoilt, as_states);
        if (!found) return found.error();
        print_cells(*found);
      }
      std::printf("\n");
      std::fflush(stdout);
    }
  }
  return {};
}

}  // namespace evpose::experiments
