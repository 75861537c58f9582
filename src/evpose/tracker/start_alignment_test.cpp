// SPDX-License-Identifier: BSD-3-Clause
// A tracker whose calibration is wrong, in a world of boxes of glass, whose edges make exact events.
#include "evpose/tracker/start_alignment.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <random>

#include "evpose/tracker/test_flight.h"
#include "evpose/tracker/tracker.h"

namespace evpose {
namespace {

using test_flight::kStart_ns;

const CameraIntrinsics kTrue{300, 300, 159.5, 119.5, "radtan", {-0.05, 0.01, 0, 0}, {320, 240}};

struct Calibrated {
  CameraIntrinsics intrinsics = kTrue;
  Pose T_body_cam = test_flight::camera_on_body();
};

Calibrated drawn(std::mt19937& random) {
  std::normal_distribution<double> normal;
  const auto draw = [&](const Eigen::VectorXd& sigma) -> Eigen::VectorXd {
    return sigma.unaryExpr([&](double s) { return s * normal(random); });
  };
  const CalibrationSigma ordinary;
  Calibrated out;
  const Eigen::VectorXd sigma = ordinary.of_intrinsics(kTrue);
  const Eigen::Index n = sigma.size();
  const Eigen::MatrixXd R = ordinary.of_correlation(kTrue).topLeftCorner(n, n);
  const Eigen::VectorXd numbers = sigma.asDiagonal() * (R.llt().matrixL() * draw(Eigen::VectorXd::Ones(n)));
  CameraIntrinsics& c = out.intrinsics;
  c.fx += numbers(0), c.fy += numbers(1), c.cx += numbers(2), c.cy += numbers(3);
  for (std::size_t i = 0; i < 4; ++i) c.distortion[i] += numbers(4 + static_cast<Eigen::Index>(i));
  out.T_body_cam.q = so3::exp(Eigen::Vector3d(draw(ordinary.of_rotation_rad()))) * out.T_body_cam.q;
  out.T_body_cam.p += draw(ordinary.of_translation_m());
  return out;
}

struct Flown {
  double camera_m = 0;  ///< error of the camera's place
  double nees = 0;      ///< of the body's pose, /6
  Health health = Health::waiting;
};

StartState at_truth() {
  StartState out;
  out.t = kStart_ns;
  out.T_map_body = test_flight::pose_at(0);
  out.velocity = test_flight::velocity_at(0);
  return out;
}

/// 0.4 s with this calibration given; `stated`: what it is said to be.
Flown fly(const Calibrated& given, const std::optional<CalibrationSigma>& stated,
          const StartState& start = at_truth(), const TrackerConfig& config = {}) {
  static const auto map = std::make_shared<const ContourMap>(test_flight::boxes());
  static const auto camera = test_flight::make_flight_camera();
  TrackerSetup setup;
  setup.camera = *make_camera(given.intrinsics);
  setup.intrinsics = given.intrinsics;
  setup.T_body_cam = given.T_body_cam;
  setup.calibration_sigma = stated;
  setup.imu_noise.rate_hz = 1000;
  setup.map = map;
  auto tracker = *Tracker::create(setup, config, start);
  Flown out;
  tracker->on_update([&](const Update& u) {
    const Pose truth = test_flight::pose_at(to_seconds(u.t - kStart_ns));
    const Vector6d off = truth.minus(u.T_map_body);
    const Calibration found = tracker->calibration();
    const Pose T_body_cam{found.turn * given.T_body_cam.q, given.T_body_cam.p + found.shift};
    out = {((u.T_map_body * T_body_cam).p - (truth * test_flight::camera_on_body()).p).norm(),
           off.dot(u.covariance.ldlt().solve(off)) / 6, u.health};
  });
  test_flight::EdgeEvents edges(*map, *camera);
  std::vector<test_flight::TimedEvent> events;
  constexpr double kStep_s = test_flight::EdgeEvents::kStep_s;
  for (int i = 0; kStep_s * i < 0.4; ++i) {
    edges.advance(kStep_s * i, false, events);
    if ((i + 1) % 4 != 0) continue;
    tracker->add_imu(test_flight::imu_at(kStep_s * i));
    const EventPacket packet = test_flight::make_packet(events, kStep_s * (i - 4));
    events.clear();
    if (!packet.empty()) tracker->add_events(packet);
  }
  return out;
}

TEST(StartAlignment, FindsTheViewOfACameraWithAnOrdinaryCalibration) {
  constexpr int kRuns = 8;
  double nees = 0, believed_m = 0, aligned_m = 0;
  for (unsigned run = 0; run < kRuns; ++run) {
    std::mt19937 random(40 + run);
    const Calibrated given = drawn(random);
    const Flown aligned = fly(given, CalibrationSigma{});
    EXPECT_EQ(aligned.health, Health::tracking) << run;
    EXPECT_LT(aligned.nees, 5) << run;
    EXPECT_LT(1e3 * aligned.camera_m, 8) << run;
    nees += aligned.nees / kRuns;
    aligned_m += aligned.camera_m / kRuns;
    believed_m += fly(given, std::nullopt).camera_m / kRuns;
  }
  EXPECT_LT(nees, 1.5);
  EXPECT_LT(1e3 * aligned_m, 4);
  EXPECT_GT(believed_m, 3 * aligned_m);
}

TEST(StartAlignment, WhatIsKnownStaysAsGiven) {
  const Flown known = fly({}, CalibrationSigma::known(kTrue)), believed = fly({}, std::nullopt);
  EXPECT_EQ(known.camera_m, believed.camera_m);
  EXPECT_EQ(known.nees, believed.nees);
}

TEST(StartAlignment, FindsAPoorStartOfAKnownCameraThatFlies) {
  TrackerConfig config;
  config.fusion.start_position_sigma_m = 0.015;
  config.fusion.start_rotation_sigma_rad = 0.003;
  config.fusion.start_velocity_sigma_m_s = 1;
  for (unsigned run = 0; run < 8; ++run) {
    std::mt19937 random(60 + run);
    std::normal_distribution<double> normal;
    Vector6d off;
    for (int i = 0; i < 6; ++i)
      off(i) = normal(random) *
               (i < 3 ? config.fusion.start_position_sigma_m : config.fusion.start_rotation_sigma_rad);
    StartState start = at_truth();
    start.T_map_body = start.T_map_body.plus(off);
    start.velocity.setZero();
    const Flown flown = fly({}, CalibrationSigma::known(kTrue), start, config);
    EXPECT_EQ(flown.health, Health::tracking) << run;
    EXPECT_LT(1e3 * flown.camera_m, 5) << run;
    EXPECT_LT(flown.nees, 5) << run;
  }
}

}  // namespace
}  // namespace evpose
