// SPDX-License-Identifier: BSD-3-Clause
// Slow errors found by the filter: a flight whose IMU clock, camera mounting or map are not as given.
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <random>

#include "evpose/fusion/ekf.h"

namespace evpose {
namespace {

const Eigen::Vector3d kGravity(0, 0, -9.81);
constexpr TimeNs kStep = 2 * kNsPerMs;  // of the IMU; every second one there is a camera pose

/// What is wrong, and what the filter is asked to find.
struct Wrong {
  double offset_s = 0;
  Eigen::Vector3d turn = Eigen::Vector3d::Zero(), shift = Eigen::Vector3d::Zero();
  Eigen::Vector2d tilt = Eigen::Vector2d::Zero();
  bool hover = false;
  bool seen_anew = false;  ///< the flight begins with a pose of the camera, as a search finds it
};

ImuSample still(TimeNs t) { return {t, {0, 0, 0}, -kGravity}; }

ImuSample moving(TimeNs t) {
  const double s = to_seconds(t);
  return {t,
          {1.2 * std::sin(5 * s), 1.0 * std::cos(4 * s), 0.9 * std::sin(3 * s)},
          {1.5 * std::sin(4 * s), 1.2 * std::cos(7 * s), 9.81 + 2 * std::cos(6 * s)}};
}

Eigen::Vector3d draw(std::mt19937& random, double sigma) {
  std::normal_distribution<double> normal(0, sigma);
  return {normal(random), normal(random), normal(random)};
}

struct Found {
  Calibration calibration;
  double frozen = 0;  ///< share of the updates
};

Found fly(const Wrong& wrong, const CalibrationConfig& calibration, const SlowErrorsConfig& slow,
          int seconds) {
  FusionConfig config;
  config.imu_noise_scale = 1;
  config.imu_scale_sigma = 0;
  config.start_rotation_sigma_rad = 0.03;
  config.start_position_sigma_m = 0.03;
  const ImuNoise noise;
  const Pose T_body_cam{so3::exp({0.1, -1.2, 0.4}), {0.1, 0.02, -0.05}};
  const Pose true_T_body_cam{so3::exp(wrong.turn) * T_body_cam.q, T_body_cam.p + wrong.shift};
  const Eigen::Vector3d gravity = so3::exp({wrong.tilt.x(), wrong.tilt.y(), 0}) * kGravity;

  // Truth and readings, sample by sample; the IMU's clock is ahead by the offset.
  std::mt19937 random(17);
  const int samples = seconds * static_cast<int>(1000 * kNsPerMs / kStep) + 50;
  std::vector<NavState> truth{{{so3::exp({0.1, -0.2, 0.8}), {1, 2, 1}}, {0, 0, 0}}};
  if (wrong.hover) truth[0].T_map_body.q = Eigen::Quaterniond::Identity();
  std::vector<ImuSample> clean, readings;
  const Eigen::Vector3d gyro_bias = draw(random, 0.01), accel_bias = draw(random, 0.05);
  const double rate = std::sqrt(1 / to_seconds(kStep));
  for (int k = 0; k < samples; ++k) {
    clean.push_back(wrong.hover ? still(k * kStep) : moving(k * kStep));
    if (k > 0)
      truth.push_back(
          strapdown(truth.back(), clean[clean.size() - 2], clean.back(), {0, 0, 0}, {0, 0, 0}, gravity));
    ImuSample s = clean.back();
    s.t += from_seconds(wrong.offset_s);
    s.gyro += gyro_bias + draw(random, noise.gyro_density * rate);
    s.accel += accel_bias + draw(random, noise.accel_density * rate);
    readings.push_back(s);
  }
  const auto reading_at = [&](TimeNs clock) {
    const auto k = static_cast<std::size_t>((clock - readings[0].t) / kStep);
    return interpolate(readings[k], readings[k + 1], clock);
  };

  Ekf ekf(StatePropagator(MotionModel::imu, config, noise), calibration, slow, T_body_cam);
  const std::size_t first = 20;
  ekf.start(static_cast<TimeNs>(first) * kStep, truth[first], {0, 0, 0});
  if (wrong.seen_anew) {
    FusionState seen = ekf.state();
    seen.nav.T_map_body = truth[first].T_map_body * true_T_body_cam * T_body_cam.inverse();
    seen.covariance.diagonal().head<6>().setConstant(1e-6);
    ekf.start(seen);
  }
  Found out;
  int updates = 0;
  for (std::size_t k = first + 2; k + 30 < truth.size(); k += 2) {
    const Calibration now = ekf.calibration();
    const TimeNs until = static_cast<TimeNs>(k) * kStep + from_seconds(now.time_offset_s);
    if (until < ekf.state().t) continue;  // the offset has fallen: that time is past
    while (ekf.state().t < until) {
      const TimeNs from = ekf.state().t;
      const TimeNs grid = readings[0].t + ((from - readings[0].t) / kStep + 1) * kStep;
      ekf.predict(reading_at(from), reading_at(std::min(grid, until)), ImuTrust::good);
    }
    Vector6d scatter;
    scatter << draw(random, 1e-3), draw(random, 5e-4);
    const Pose T_map_cam = truth[k].T_map_body.plus(scatter) * true_T_body_cam;
    const Pose assumed{now.turn * T_body_cam.q, T_body_cam.p + now.shift};
    PoseInformation m;
    Vector6d information;
    information << 1e6, 1e6, 1e6, 4e6, 4e6, 4e6;
    m.information = information.asDiagonal();
    m.vector = m.information * (T_map_cam * assumed.inverse()).minus(ekf.state().nav.T_map_body);
    ekf.update(m);
    ++updates;
    out.frozen += ekf.calibration().frozen ? 1 : 0;
  }
  out.frozen /= updates;
  out.calibration = ekf.calibration();
  return out;
}

double rotation_error_deg(const Calibration& found, const Eigen::Vector3d& turn) {
  return so3::log(found.turn * so3::exp(turn).conjugate()).norm() * 180 / M_PI;
}

TEST(Calibration, TimeOffsetOfTwentyMillisecondsIsFoundToATenth) {
  CalibrationConfig c;
  c.time_offset = true;
  for (const double offset_s : {-0.02, 0.0, 0.02}) {
    Wrong wrong;
    wrong.offset_s = offset_s;
    const Calibration found = fly(wrong, c, {}, 5).calibration;
    EXPECT_NEAR(found.time_offset_s, offset_s, 1e-4);
    EXPECT_LT(std::abs(found.time_offset_s - offset_s), 4 * found.time_sigma_s + 1e-5);
    EXPECT_FALSE(found.frozen);
  }
}

TEST(Calibration, RotationOfOneDegreeIsFoundToAFiftieth) {
  CalibrationConfig c;
  c.rotation = true;
  Wrong wrong;
  wrong.turn = Eigen::Vector3d(0.6, -0.5, 0.62) * (M_PI / 180);
  const Calibration found = fly(wrong, c, {}, 12).calibration;
  EXPECT_LT(rotation_error_deg(found, wrong.turn), 0.02);
  EXPECT_LT(found.turn_sigma_rad.norm() * 180 / M_PI, 0.02);
}

TEST(Calibration, APoseThatTheCameraFoundDoesNotVouchForTheBody) {
  CalibrationConfig c;
  c.rotation = true;
  Wrong wrong;
  wrong.turn = Eigen::Vector3d(0.6, -0.5, 0.62) * (M_PI / 180);
  wrong.seen_anew = true;
  EXPECT_LT(rotation_error_deg(fly(wrong, c, {}, 12).calibration, wrong.turn), 0.02);
}

TEST(Calibration, PlaceOfTheCameraIsFoundToAMillimetre) {
  CalibrationConfig c;
  c.translation = true;
  Wrong wrong;
  wrong.shift = {0.01, -0.015, 0.008};
  const Calibration found = fly(wrong, c, {}, 12).calibration;
  EXPECT_LT((found.shift - wrong.shift).norm(), 1e-3);
  EXPECT_LT((found.shift - wrong.shift).cwiseQuotient(found.shift_sigma_m).cwiseAbs().maxCoeff(), 4);
}

TEST(Calibration, AllThreeAreFoundTogether) {
  CalibrationConfig c;
  c.time_offset = c.rotation = c.translation = true;
  Wrong wrong;
  wrong.offset_s = 0.005;
  wrong.turn = Eigen::Vector3d(-0.3, 0.5, 0.2) * (M_PI / 180);
  wrong.shift = {-0.005, 0.01, 0.004};
  const Calibration found = fly(wrong, c, {}, 12).calibration;
  EXPECT_NEAR(found.time_offset_s, wrong.offset_s, 1e-4);
  EXPECT_LT(rotation_error_deg(found, wrong.turn), 0.02);
  EXPECT_LT((found.shift - wrong.shift).norm(), 1e-3);
}

TEST(Calibration, InHoverItIsFrozenAndSaidSo) {
  CalibrationConfig c;
  c.time_offset = c.rotation = c.translation = true;
  Wrong wrong;
  wrong.hover = true;
  wrong.turn = {0.01, 0, 0};
  const Found found = fly(wrong, c, {}, 3);
  EXPECT_GT(found.frozen, 0.99);
  EXPECT_TRUE(found.calibration.frozen);
  EXPECT_EQ(found.calibration.time_offset_s, 0);
  EXPECT_EQ(found.calibration.shift, Eigen::Vector3d(0, 0, 0));
  EXPECT_EQ(found.calibration.time_sigma_s, c.start_time_sigma_s) << "what is not estimated stays as unsure";
}

TEST(Calibration, TiltOfTheMapIsFound) {
  SlowErrorsConfig slow;
  slow.gravity = true;
  Wrong wrong;
  wrong.tilt = {0.005, -0.004};
  const Calibration found = fly(wrong, {}, slow, 12).calibration;
  EXPECT_LT((found.gravity_tilt_rad - wrong.tilt).norm(), 4e-4);
  EXPECT_LT(
      (found.gravity_tilt_rad - wrong.tilt).cwiseQuotient(found.gravity_sigma_rad).cwiseAbs().maxCoeff(), 4);
}

TEST(Calibration, WhatWasFoundOutlivesANewStart) {
  CalibrationConfig c;
  c.time_offset = true;
  Ekf ekf(StatePropagator(MotionModel::imu, FusionConfig{}, ImuNoise{}), c);
  NavState nav;
  nav.velocity = {1, 0, 0};
  ekf.start(0, nav, {0, 0, 0});
  // A velocity that changes, so that nothing is frozen.
  for (int k = 0; k < 50; ++k) {
    ekf.predict({k * kStep, {0, 0, 1}, {4, 0, 9.81}}, {(k + 1) * kStep, {0, 0, 1}, {4, 0, 9.81}},
                ImuTrust::good);
    PoseInformation m;
    m.information.diagonal().setConstant(1e6);
    m.vector(0) = 1e6 * 2e-3;
    ekf.update(m);
  }
  const Calibration before = ekf.calibration();
  EXPECT_NE(before.time_offset_s, 0);
  ekf.start(ekf.state());
  EXPECT_EQ(ekf.calibration().time_offset_s, before.time_offset_s);
  EXPECT_EQ(ekf.calibration().time_sigma_s, before.time_sigma_s);
}

/// An error of the measured pose that lasts is not taken for the pose when the filter knows of it.
TEST(SlowErrors, ALastingOffsetMakesThePoseHonest) {
  FusionConfig config;
  config.imu_noise_scale = 1;
  config.imu_scale_sigma = 0;
  for (const bool known : {false, true}) {
    std::mt19937 random(3);
    SlowErrorsConfig slow;
    slow.pose_offset = known;
    slow.offset_position_sigma_m = 2e-3;
    slow.offset_rotation_sigma_rad = 1e-9;
    slow.offset_s = 0.3;
    double nees = 0;
    int count = 0;
    for (int run = 0; run < 6; ++run) {
      Ekf ekf(StatePropagator(MotionModel::imu, config, ImuNoise{}), {}, slow);
      ekf.start(0, {}, {0, 0, 0});
      Eigen::Vector3d offset = draw(random, 2e-3);
      const double keep = std::exp(-to_seconds(kStep) / slow.offset_s);
      NavState truth;
      for (int k = 0; k < 1000; ++k) {
        ImuSample a = still(k * kStep), b = still((k + 1) * kStep);
        const double rate = std::sqrt(1 / to_seconds(kStep));
        const ImuNoise noise;
        const Eigen::Vector3d ng = draw(random, noise.gyro_density * rate),
                              na = draw(random, noise.accel_density * rate);
        for (ImuSample* s : {&a, &b}) s->gyro += ng, s->accel += na;
        ekf.predict(a, b, ImuTrust::good);
        offset = keep * offset + draw(random, 2e-3 * std::sqrt(1 - keep * keep));
        PoseInformation m;
        Vector6d information, z;
        information << 1e6, 1e6, 1e6, 4e6, 4e6, 4e6;
        z.head<3>() = offset;
        z.head<3>() += draw(random, 1e-3);
        z.tail<3>() = draw(random, 5e-4);
        m.information = information.asDiagonal();
        const Vector6d ahead = truth.T_map_body.minus(ekf.state().nav.T_map_body);
        m.vector = m.information * (ahead + z);
        ekf.update(m);
        if (k < 300) continue;
        const Eigen::Vector3d e = ekf.state().nav.T_map_body.p - truth.T_map_body.p;
        nees += e.dot(ekf.state().covariance.topLeftCorner<3, 3>().inverse() * e) / 3;
        ++count;
      }
    }
    if (known)
      EXPECT_NEAR(nees / count, 1, 0.5);
    else
      EXPECT_GT(nees / count, 5);
  }
}

}  // namespace
}  // namespace evpose
