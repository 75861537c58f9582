// SPDX-License-Identifier: BSD-3-Clause
// What becomes of a pose that was given, in a world of boxes of glass, whose edges make exact events.
#include "evpose/tracker/pose_supervisor.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "evpose/map/contour_index.h"
#include "evpose/tracker/test_flight.h"
#include "evpose/tracker/tracker_config.h"

namespace evpose {
namespace {

using test_flight::kStart_ns;
using test_flight::pose_at;

constexpr double kUpdate_s = 3e-3, kFlight_s = 1.9;
constexpr int kLookEvery = 4;  // updates
constexpr double kConcentration = 0.4, kConcentrationOff = 0.2;

class PoseSupervisorLaws : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    camera_ = test_flight::make_flight_camera();
    world_ = test_flight::boxes();
    events_ = test_flight::record(world_, *camera_, kFlight_s);
  }

  PoseSupervisorLaws()
      : index_(world_),
        segments_(cut_into_segments(world_)),
        fusion_(make_back_end(MotionModel::imu, {}, {}, test_flight::camera_on_body())) {
    fusion_->start(kStart_ns, {pose_at(0), test_flight::velocity_at(0)}, Eigen::Vector3d::Zero());
    wrong_in_one_direction_ = world_;
    for (ContourPoint& p : wrong_in_one_direction_.points)
      if (std::abs(p.tangent.y()) < 0.9F) p.position.y() += 0.23F;
  }

  PoseSupervisor given_pose(bool map_may_be_wrong) {
    const RelocalizerScene scene{index_, segments_, *camera_, {0, 0, -9.81}, {}, {}};
    PoseSupervisor out({}, {}, Relocalizer(scene),
                       PoseVerifier(camera_->size(), std::vector<bool>(segments_.count), false),
                       map_may_be_wrong);
    out.start(fusion_->state(), 0);
    t_s_ = 0;
    return out;
  }

  /// The events go on for so long, and contours are believed to be where `map` has them, seen from a pose off
  /// the true one.
  void fly(PoseSupervisor& supervisor, double duration_s, const ContourMap& map,
           const Vector6d& off = Vector6d::Zero()) {
    const ContourView view{map, segments_, *camera_, test_flight::camera_on_body(), 1e-3};
    std::vector<std::uint32_t> points(map.points.size());
    std::iota(points.begin(), points.end(), 0U);
    RegistrationResult registration;
    registration.points = registration.inliers = 100;
    registration.gate_concentration = off.isZero() ? kConcentration : kConcentrationOff;
    for (const double until_s = t_s_ + duration_s; t_s_ < until_s; t_s_ += kUpdate_s, ++updates_) {
      if (updates_ % kLookEvery == 0 && !supervisor.searching()) look(supervisor, view, points, off);
      std::string reason;
      health_ = supervisor.judge(
          {kStart_ns + from_seconds(t_s_), kUpdate_s, registration, "", "", {*camera_, view.T_body_cam, 3}},
          *fusion_, &reason);
    }
  }

 private:
  void look(PoseSupervisor& supervisor, const ContourView& view, std::span<const std::uint32_t> points,
            const Vector6d& off) const {
    std::vector<ContourSample> samples;
    const BodyMotion body{pose_at(t_s_).plus(off), test_flight::velocity_at(t_s_),
                          test_flight::imu_at(t_s_).gyro};
    project_contours(view, points, body, kUpdate_s, samples);
    std::erase_if(samples, [](const ContourSample& s) { return !camera_->size().contains(s.pixel); });
    supervisor.look(test_flight::filtered_between(events_, t_s_ - kUpdate_s, t_s_), samples, kUpdate_s,
                    kLookEvery * kUpdate_s, {});
  }

 protected:
  inline static std::shared_ptr<const Camera> camera_;
  inline static ContourMap world_;
  inline static std::vector<test_flight::TimedEvent> events_;
  ContourIndex index_;
  ContourSegments segments_;
  std::unique_ptr<BackEnd> fusion_;
  ContourMap wrong_in_one_direction_;
  double t_s_ = 0;
  Health health_ = Health::waiting;  ///< at the last update
  int updates_ = 0;
};

Vector6d far_off() {
  Vector6d off = Vector6d::Zero();
  off.head<3>() << 0.1, -0.15, 0.1;
  return off;
}

TEST_F(PoseSupervisorLaws, WhereEventsAgreeItIsVerifiedAndNotSearched) {
  PoseSupervisor supervisor = given_pose(true);
  fly(supervisor, 0.3, world_);
  EXPECT_TRUE(supervisor.initialised());
  fly(supervisor, 1.4, world_);
  EXPECT_FALSE(supervisor.searching());
}

TEST_F(PoseSupervisorLaws, WhereEventsContradictItItIsSearchedLaterInAMapThatStatesErrors) {
  PoseSupervisor true_map = given_pose(false);
  fly(true_map, 0.8, world_, far_off());
  EXPECT_TRUE(true_map.searching());
  PoseSupervisor built = given_pose(true);
  fly(built, 0.8, world_, far_off());
  EXPECT_FALSE(built.searching());
  fly(built, 0.5, world_, far_off());
  EXPECT_TRUE(built.searching());
}

TEST_F(PoseSupervisorLaws, ItIsTrackingOnceItIsProbableAndNoLongerThanThat) {
  PoseSupervisor supervisor = given_pose(true);
  EXPECT_LT(supervisor.probability(), PoseProbability::kBelieved);
  while (t_s_ < 0.3) {
    fly(supervisor, kUpdate_s, world_);
    const bool probable = supervisor.probability() >= PoseProbability::kBelieved;
    EXPECT_TRUE(probable || health_ != Health::tracking) << t_s_;
  }
  EXPECT_EQ(health_, Health::tracking);
  fly(supervisor, 0.4, world_, far_off());
  EXPECT_LT(supervisor.probability(), 0.5);
  EXPECT_NE(health_, Health::tracking);
}

/// As maps of clouds often are: contours of one direction stand where nothing is.
TEST_F(PoseSupervisorLaws, OneThatEventsAgreeWithButForOneDirectionIsNotContradicted) {
  PoseSupervisor supervisor = given_pose(true);
  fly(supervisor, 0.3, world_, far_off());
  fly(supervisor, 0.35, wrong_in_one_direction_);
  fly(supervisor, 0.6, world_, far_off());
  EXPECT_FALSE(supervisor.searching());
  EXPECT_FALSE(supervisor.initialised());
  fly(supervisor, 0.6, world_, far_off());
  EXPECT_TRUE(supervisor.searching());
}

/// Unlike one that was never verified, which is not called tracking meanwhile.
TEST_F(PoseSupervisorLaws, OneThatWasVerifiedStaysContradictedWhileOneDirectionDisagrees) {
  PoseSupervisor supervisor = given_pose(true);
  fly(supervisor, 0.1, world_);
  EXPECT_EQ(health_, Health::tracking);
  fly(supervisor, 0.4, world_, far_off());
  EXPECT_EQ(health_, Health::degraded);
  // Looks of a while later agree in all directions that are seen.
  for (int i = 0; i < 50; ++i) {
    fly(supervisor, kUpdate_s, wrong_in_one_direction_);
    EXPECT_EQ(health_, Health::degraded) << i;
  }
}

}  // namespace
}  // namespace evpose
