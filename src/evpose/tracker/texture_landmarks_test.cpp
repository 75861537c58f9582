// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/texture_landmarks.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "evpose/fusion/ekf.h"

namespace evpose {
namespace {

const Eigen::Vector3d kGravity(0, 0, -9.81);
constexpr TimeNs kUpdate = 4 * kNsPerMs;

/// A wall at z = 3 m before a camera that looks along z, with printed lines that no map knows.
class BeforeAWall : public ::testing::Test {
 protected:
  BeforeAWall()
      : camera_(*make_camera({200, 200, 159.5, 119.5, "none", {}, {320, 240}})),
        map_(wall()),
        index_(map_),
        landmarks_(index_, *camera_, T_body_cam_, nullptr) {
    std::uniform_real_distribution<double> across(-2, 2), turn(0, M_PI);
    for (int i = 0; i < 60; ++i) lines_.push_back({{across(random_), across(random_)}, turn(random_)});
  }

  static ContourMap wall() {
    ContourMap map;
    map.occluders.vertices = {{-9, -9, 3}, {9, -9, 3}, {9, 9, 3}, {-9, 9, 3}};
    map.occluders.triangles = {{0, 1, 2}, {0, 2, 3}};
    return map;
  }

  struct Line {
    Eigen::Vector2d middle;
    double turn;
  };
  /// Events of the lines from `from` to `to`, seen by a camera that moves evenly.
  std::vector<Event> events(TimeNs from, TimeNs to) {
    std::uniform_real_distribution<double> along(-0.3, 0.3), when(0, 1);
    std::normal_distribution<double> scatter_px(0, 0.4);
    std::vector<Event> out;
    for (const Line& line : lines_)
      for (int k = 0; k < 12; ++k) {
        const double t_s = to_seconds(from) + when(random_) * to_seconds(to - from), s = along(random_);
        const Eigen::Vector3d point(line.middle.x() + s * std::cos(line.turn),
                                    line.middle.y() + s * std::sin(line.turn), 3);
        const auto pixel = camera_->project(point - t_s * velocity_);
        if (!pixel || !camera_->size().contains(*pixel, 2)) continue;
        const Eigen::Vector2d at =
            *pixel + scatter_px(random_) * Eigen::Vector2d(-std::sin(line.turn), std::cos(line.turn));
        out.push_back(make_event(static_cast<std::uint32_t>(1e6 * t_s - 1e-3 * static_cast<double>(from)),
                                 static_cast<int>(std::lround(at.x())), static_cast<int>(std::lround(at.y())),
                                 true));
      }
    std::sort(out.begin(), out.end(), [](const Event& a, const Event& b) { return a.dt_us < b.dt_us; });
    return out;
  }

  /// Tracks for that long by the landmarks and a perfect IMU alone, from a velocity that is wrong.
  Ekf track(const Eigen::Vector3d& error_m_s, TimeNs until, FusionConfig config = {}) {
    config.start_velocity_sigma_m_s = 0.1;
    const Pose given = T_body_cam_;
    Ekf ekf(StatePropagator(MotionModel::imu, config, {}), config, given);
    ekf.start(0, {{}, velocity_ + error_m_s}, {0, 0, 0});
    EventPreprocessor preprocessor(camera_->size().width, camera_->size().height, {});
    const InterestMap nowhere(camera_->size().width, camera_->size().height);
    preprocessor.set_interest(&nowhere);
    for (TimeNs t = 0; t < until; t += kUpdate) {
      landmarks_.prepare(t + kUpdate, preprocessor);
      FusionState coming = ekf.state();
      coming.nav.T_map_body.p += to_seconds(kUpdate) * coming.nav.velocity;
      if (const auto found_at = ekf.kept_pose()) landmarks_.expect(coming, to_seconds(kUpdate), *found_at);
      const std::vector<Event> some = events(t, t + kUpdate);
      const EventPacket packet{t, some};
      preprocessor.take(packet, packet.events);
      const std::uint32_t now_us = preprocessor.stamp(t + kUpdate);
      landmarks_.look_at(now_us);
      ekf.predict({t, {0, 0, 0}, -kGravity}, {t + kUpdate, {0, 0, 0}, -kGravity}, ImuTrust::good);
      landmarks_.update({t + kUpdate, now_us, to_seconds(kUpdate), &coming.nav, 60}, ekf);
      T_body_cam_.q = ekf.calibration().turn * given.q;
      most_ = std::max(most_, landmarks_.size());
    }
    return ekf;
  }

  std::mt19937 random_{11};
  std::shared_ptr<const Camera> camera_;
  Pose T_body_cam_;
  ContourMap map_;
  ContourIndex index_;
  TextureLandmarks landmarks_;
  std::vector<Line> lines_;
  Eigen::Vector3d velocity_{0.4, -0.25, 0.1};
  std::size_t most_ = 0;
};

TEST_F(BeforeAWall, LandmarksTellTheVelocity) {
  const Eigen::Vector3d wrong(0.12, 0.08, -0.1);
  const Ekf ekf = track(wrong, 600 * kNsPerMs);
  EXPECT_GT(most_, 30u);
  const FusionState& state = ekf.state();
  const Eigen::Vector3d error = state.nav.velocity - velocity_;
  const Eigen::Vector3d sigma =
      state.covariance.block<3, 3>(error_state::kV, error_state::kV).diagonal().cwiseSqrt();
  EXPECT_LT(error.norm(), 0.2 * wrong.norm());
  for (int i = 0; i < 3; ++i) EXPECT_LT(std::abs(error(i)), 4 * sigma(i)) << i;
  EXPECT_LT(sigma.maxCoeff(), 0.05);
}

/// The first pose's error stays: nothing told of it.
TEST_F(BeforeAWall, LandmarksTellNothingOfWhereTheCameraIs) {
  FusionConfig config;
  const Ekf ekf = track({0, 0, 0}, 300 * kNsPerMs);
  const Matrix6d P = ekf.state().pose_covariance();
  for (int i = 0; i < 3; ++i) EXPECT_GT(std::sqrt(P(i, i)), 0.95 * config.start_position_sigma_m) << i;
}

Eigen::Vector3d velocity_sigma(const Ekf& ekf) {
  return ekf.state().covariance.block<3, 3>(error_state::kV, error_state::kV).diagonal().cwiseSqrt();
}

/// A camera that is turned in the body sees the body move another way. What is not known of the turn is not
/// known of the velocity.
TEST_F(BeforeAWall, WhatTheCameraMayBeTurnedByIsInTheVelocitysSigma) {
  constexpr TimeNs kUntil = 1500 * kNsPerMs;
  const double known_m_s = velocity_sigma(track({0, 0, 0}, kUntil)).norm();
  landmarks_.restart();
  T_body_cam_.q = so3::exp(Eigen::Vector3d(0.2, -0.2, 0));
  FusionConfig config;
  config.calibration.rotation = true;
  config.calibration.start_rotation_sigma_rad.setConstant(0.2);
  const Ekf ekf = track({0, 0, 0}, kUntil, config);
  EXPECT_GT(velocity_sigma(ekf).norm(), 2 * known_m_s);
  const Eigen::Vector3d error = ekf.state().nav.velocity - velocity_;
  for (int i = 0; i < 3; ++i) EXPECT_LT(std::abs(error(i)), 4 * velocity_sigma(ekf)(i)) << i;
}

TEST_F(BeforeAWall, WithoutSurfacesThereAreNone) {
  map_.occluders = {};
  track({0, 0, 0}, 200 * kNsPerMs);
  EXPECT_EQ(most_, 0u);
}

}  // namespace
}  // namespace evpose
