// SPDX-License-Identifier: BSD-3-Clause
// make_reports FOLDER: a run folder FOLDER/run and a judged trajectory FOLDER/eval.html from made-up data,
// for report_test.py to look at.
#include <cmath>
#include <cstdio>
#include <random>
#include <vector>

#include "evpose/fusion/back_end.h"
#include "evpose/io/files/atomic_file.h"
#include "evpose/report/overlay.h"
#include "evpose/report/page.h"
#include "evpose/report/run_folder.h"

namespace {

using namespace evpose;

Pose flight(double t_s) {
  return {so3::exp({0.2 * std::sin(t_s), 0.1 * std::cos(1.3 * t_s), 0.4 * t_s}),
          {2.5 + 1.2 * std::sin(0.9 * t_s), 2 + 0.9 * std::cos(0.7 * t_s), 1.2 + 0.4 * std::sin(0.5 * t_s)}};
}

Health health_at(double t_s) {
  if (t_s < 0.05) return Health::initialising;
  if (t_s > 5 && t_s < 5.4) return Health::degraded;
  if (t_s >= 5.4 && t_s < 5.7) return Health::lost;
  return Health::tracking;
}

class Run {
 public:
  Update at(int i) {
    const double t_s = i / 300.0;
    Update u;
    u.t = from_seconds(t_s);
    const double sigma_m = 0.002 * (1 + 0.5 * std::sin(t_s)), sigma_rad = 4e-4;
    for (int k = 0; k < 6; ++k) error_[k] = 0.98 * error_[k] + 0.2 * normal_(random_);
    Vector6d scaled = error_;
    scaled.head<3>() *= sigma_m;
    scaled.tail<3>() *= sigma_rad;
    u.T_map_body = flight(t_s).plus(scaled);
    u.covariance.diagonal() << Eigen::Vector3d::Constant(sigma_m * sigma_m),
        Eigen::Vector3d::Constant(sigma_rad * sigma_rad);
    u.velocity =
        Eigen::Vector3d(1.08 * std::cos(0.9 * t_s), -0.63 * std::sin(0.7 * t_s), 0.2 * std::cos(0.5 * t_s));
    u.velocity_covariance = 1e-4 * Eigen::Matrix3d::Identity();
    u.gyro_bias = Eigen::Vector3d(0.01, -0.007, 0.004) * (1 - std::exp(-3 * t_s));
    u.accel_bias = Eigen::Vector3d(0.03, 0.06, -0.05) * (1 - std::exp(-2 * t_s));
    u.health = health_at(t_s);
    if (u.health != last_) u.reason = "an example <b>reason</b>";
    last_ = u.health;
    u.events_read = 6000 + static_cast<int>(3000 * std::sin(2 * t_s) + 300 * normal_(random_));
    u.events_kept = u.events_read * 7 / 10;
    u.points = 1500;
    u.points_matched = u.health == Health::lost ? 20 : 1100 + static_cast<int>(60 * normal_(random_));
    const auto ms = [&](double typical) { return 1e-3 * typical * std::exp(0.25 * normal_(random_)); };
    u.times = {ms(0.15), ms(0.01), ms(0.09), ms(0.4), ms(0.02)};
    return u;
  }

 private:
  std::mt19937 random_{5};
  std::normal_distribution<double> normal_;
  Vector6d error_ = Vector6d::Zero();
  Health last_ = Health::waiting;
};

/// What is found of the calibration settles, its sigmas shrink.
Calibration found_at(double t_s) {
  const double share = 1 - std::exp(-t_s), left = std::exp(-0.5 * t_s);
  Calibration c;
  c.time_offset_s = 4e-4 * share;
  c.time_sigma_s = 1e-3 * left;
  c.turn = so3::exp(Eigen::Vector3d(0.002, -0.001, 0.003) * share);
  c.turn_sigma_rad.setConstant(0.005 * left);
  c.shift = Eigen::Vector3d(0.001, 0.002, -0.001) * share;
  c.shift_sigma_m.setConstant(0.01 * left);
  c.gravity_sigma_rad.setConstant(0.003 * left);
  c.intrinsics.setConstant(8, 0.3 * share);
  c.intrinsics_sigma.setConstant(8, 1 * left);
  return c;
}

RunCalibration calibration() {
  RunCalibration out;
  out.given.intrinsics =
      CameraIntrinsics{460, 461, 319.5, 239.5, "radtan", {-0.1, 0.02, 5e-4, -3e-4}, {640, 480}};
  out.given.T_cam_imu = Pose{so3::exp({0.1, 0, 0}), {0.05, 0, 0}};
  out.found = out.given;
  out.found.intrinsics->fx += 0.3;
  out.found.sigma.time_s = 1e-4;
  return out;
}

RgbImage picture(int which) {
  constexpr int kWidth = 320, kHeight = 240;
  std::vector<float> decay(static_cast<std::size_t>(kWidth * kHeight), 0.0f);
  std::vector<OverlayPoint> points;
  for (int y = 0; y < kHeight; ++y) {
    const int edge = 60 + 20 * which + y / 3;
    for (int age = 0; age < 5; ++age)
      decay[static_cast<std::size_t>(y * kWidth + edge - age)] = std::exp(-0.4f * static_cast<float>(age));
    decay[static_cast<std::size_t>(y * kWidth + edge + 70)] = -0.9f;
    if (y % 6 == 0) points.push_back({static_cast<float>(edge) + 1, static_cast<float>(y), y % 5 != 0});
  }
  return draw_overlay(kWidth, kHeight, decay, points);
}

Status make(const std::string& folder) {
  auto made = RunFolder::create(folder + "/run", true);
  if (!made) return made.error();
  Run run;
  for (int i = 0; i <= 2400; ++i) {
    made->add(run.at(i));
    made->add_calibration(from_seconds(i / 300.0), found_at(i / 300.0));
  }
  for (int i = 0; i < 6; ++i)
    made->add_overlay(text("at ", i, ".000 s, 1,100 of 1,500 points matched"), picture(i));

  RunSummary summary;
  summary.title = "made-up <room> & </script> flight";
  summary.subtitle = "map: room.ply; start: ground truth";
  summary.start = "started from ground truth";
  summary.calibration = calibration();
  for (int i = 0; i <= 8000; ++i) summary.truth.push_back({i * kNsPerMs, flight(1e-3 * i)});
  for (int i = 0; i < 1000; ++i)
    for (const double z : {0.0, 3.0}) {
      const double s = i / 250.0 * 5;
      summary.map_points.emplace_back(i < 250   ? s
                                      : i < 500 ? 5
                                      : i < 750 ? 15 - s
                                                : 0,
                                      i < 250   ? 0
                                      : i < 500 ? s - 5
                                      : i < 750 ? 5
                                                : 20 - s,
                                      z);
    }
  summary.events_read = 14'000'000;
  summary.events_kept = 10'000'000;
  summary.wall_s = 4;
  summary.cpu_s = 3.9;
  summary.peak_memory_mb = 64;
  double rate_hz = 300;
  ConfigTable table;
  table.add("tracker.rate_hz", rate_hz, "Hz", "updates per second of data time", {1, 1000});
  const auto out = made->finish(summary, table);
  if (!out) return out.error();

  std::vector<TimedPose> estimate;
  Run again;
  for (int i = 0; i <= 2400; ++i) {
    const Update u = again.at(i);
    estimate.push_back({u.t, u.T_map_body});
  }
  const TrajectoryScore score = score_trajectory({estimate, summary.truth, {}, {}, {}}, {});
  return write_text_file(folder + "/eval.html", score_page("a judged trajectory", "", score, summary.truth));
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  const Status done = make(argv[1]);
  if (!done) std::fprintf(stderr, "make_reports: %s\n", done.error().line().c_str());
  return done ? 0 : 2;
}
