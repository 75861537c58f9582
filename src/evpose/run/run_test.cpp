// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include "evpose/core/geodesy.h"
#include "evpose/io/files/test_files.h"
#include "evpose/io/maps/map_h5.h"
#include "evpose/run/kept_places.h"
#include "evpose/run/plausibility.h"
#include "evpose/run/progress.h"
#include "evpose/run/start.h"

namespace evpose {
namespace {

/// The corners of a box, far from the origin.
ContourMap box(double side_m) {
  ContourMap map;
  map.anchor = {100, 200, 0};
  for (const double x : {0.0, side_m})
    for (const double y : {0.0, side_m}) {
      ContourPoint p;
      p.position = Eigen::Vector3d(x, y, 0.5 * x).cast<float>();
      map.points.push_back(p);
    }
  return map;
}

TEST(Plausibility, AMapInAnotherUnitIsDoubtedAndOneInMetresIsNot) {
  for (const double metres : {2.0, 8.0, 300.0}) EXPECT_FALSE(doubt_map_size(box(metres))) << metres;
  const auto centimetres = doubt_map_size(box(812)), kilometres = doubt_map_size(box(0.02));
  ASSERT_TRUE(centimetres && kilometres);
  EXPECT_EQ(centimetres->what, "map is 812 m wide: centimetres or millimetres?");
  EXPECT_NE(kilometres->what.find("kilometres"), std::string::npos);
  EXPECT_FALSE(doubt_map_size({}));
}

TEST(Plausibility, AStartOutsideOfTheMapIsDoubtedByItsDistance) {
  const ContourMap map = box(10);
  EXPECT_FALSE(doubt_start_place(map, {Eigen::Quaterniond::Identity(), {105, 205, 1}}));
  EXPECT_FALSE(doubt_start_place(map, {Eigen::Quaterniond::Identity(), {110.4, 205, 1}}));
  const auto doubt = doubt_start_place(map, {Eigen::Quaterniond::Identity(), {113, 214, 1}});
  ASSERT_TRUE(doubt);
  EXPECT_EQ(doubt->what, "lies 5 m outside of the map's bounds");  // 3 and 4 m along the axes
  ContourMap wall = map;
  for (ContourPoint& point : wall.points) point.position.x() *= 0.1F;
  EXPECT_FALSE(doubt_start_place(wall, {Eigen::Quaterniond::Identity(), {96, 205, 0.2}}));
}

/// An IMU that turns about its y axis while it falls onto nothing: specific force is up, as it sees it.
std::vector<ImuSample> turning_imu(double rate_rad_s) {
  std::vector<ImuSample> out;
  for (int i = 0; i <= 200; ++i) {
    const double t_s = 0.005 * i;
    ImuSample s;
    s.t = from_seconds(t_s);
    s.gyro = {0, rate_rad_s, 0};
    s.accel = so3::exp(Eigen::Vector3d(0, -rate_rad_s * t_s, 0)) * Eigen::Vector3d(0, 0, 9.81);
    out.push_back(s);
  }
  return out;
}

TEST(Plausibility, AStartWhoseUpIsNotThatOfTheAccelerometerIsDoubtedByTheAngle) {
  StartState start;
  const auto samples = turning_imu(2);  // by 57 deg in the half second: what counts is the start's attitude
  EXPECT_FALSE(doubt_start_attitude(samples, start, "imu.csv"));
  start.T_map_body.q = so3::exp({0.3, 0, 0});
  EXPECT_FALSE(doubt_start_attitude(samples, start, "imu.csv"));
  start.T_map_body.q = so3::exp({0, M_PI / 2, 0});
  const auto doubt = doubt_start_attitude(samples, start, "imu.csv");
  ASSERT_TRUE(doubt);
  EXPECT_EQ(doubt->where, "imu.csv");
  EXPECT_NE(doubt->what.find(" 90 deg"), std::string::npos) << doubt->what;
  start.t = from_seconds(5);  // after the samples: nothing can be said
  EXPECT_FALSE(doubt_start_attitude(samples, start, "imu.csv"));
  EXPECT_FALSE(doubt_start_attitude({}, start, "imu.csv"));
  EXPECT_FALSE(up_by_accelerometer({}, start.t));
}

TEST(RemainingTime, OfASteadyJobIsRightAfterItsFirstSeconds) {
  RemainingTime remaining;
  for (double spent_s = 0.1; spent_s < 3; spent_s += 0.1) EXPECT_FALSE(remaining.at(spent_s / 60, spent_s));
  for (double spent_s = 3.1; spent_s < 60; spent_s += 1)
    EXPECT_NEAR(remaining.at(spent_s / 60, spent_s).value(), 60 - spent_s, 1e-9);
  EXPECT_EQ(remaining.at(1, 60), 0);
  EXPECT_FALSE(RemainingTime().at(0, 100));
}

TEST(RemainingTime, NeverGrowsAndIsSilentWhileItIsWrong) {
  RemainingTime remaining;
  double last_s = 1e9, spent_s = 0;
  int silent = 0;
  // Fast, then slow, then fast again.
  for (double fraction = 0; fraction <= 1; fraction += 0.001) {
    spent_s += fraction > 0.4 && fraction < 0.6 ? 0.2 : 0.02;
    const auto left_s = remaining.at(fraction, spent_s);
    silent += spent_s > 10 && !left_s ? 1 : 0;
    EXPECT_LE(left_s.value_or(last_s), last_s);
    last_s = left_s.value_or(last_s);
  }
  EXPECT_GT(silent, 100);
  EXPECT_LT(last_s, 0.2);
}

TEST(Start, WordsTellWhereThePoseComesFrom) {
  EXPECT_EQ(start_words("auto", true), "started from ground truth");
  EXPECT_EQ(start_words("groundtruth", true), "started from ground truth");
  EXPECT_EQ(start_words("auto", false), "started from the recording's initial_pose");
  EXPECT_EQ(start_words("1,2,3,0,0,0,1", true), "started from --init");
  EXPECT_EQ(start_words("a.tum", true), "started from a.tum");
  EXPECT_EQ(start_words("anywhere", true), "started anywhere in the map");
  EXPECT_EQ(start_words("gps:1,2,3", true), "started from a place by GPS");
}

class StartByGps : public testing::Test {
 protected:
  StartByGps() {
    recording_.has_imu = true;
    recording_.first_ns = 7;
    placement_.origin_llh = Eigen::Vector3d(47.4, 8.5, 400);
  }
  Expected<StartState> start(const std::string& init) {
    return choose_start(init, recording_, {}, {}, placement_, &fusion_);
  }

  Recording recording_;
  MapPlacement placement_;
  FusionConfig fusion_;
};

TEST_F(StartByGps, IsEastAndNorthOfTheMapsOrigin) {
  const auto s = start("gps:47.4001,8.5002,412");
  ASSERT_TRUE(s);
  const Eigen::Vector3d ned = ned_from_llh({47.4001, 8.5002, 412}, *placement_.origin_llh);
  EXPECT_LT((s->T_map_body.p - Eigen::Vector3d(ned.y(), ned.x(), -ned.z())).norm(), 1e-9);
  EXPECT_NEAR(s->T_map_body.p.y(), 11.1, 0.1) << "a ten-thousandth of a degree of latitude";
  EXPECT_EQ(s->t, 7);
  EXPECT_EQ(fusion_.start_position_sigma_m, kGpsSigma_m);
}

TEST_F(StartByGps, WhereThePlacedMapHasIt) {
  placement_.T_ned_map = Pose{so3::exp({0.1, 0.2, 0.3}), {4, 5, 6}};
  const auto s = start("gps:47.4001,8.5002,412,1.5");
  ASSERT_TRUE(s);
  const Eigen::Vector3d ned = ned_from_llh({47.4001, 8.5002, 412}, *placement_.origin_llh);
  EXPECT_LT((*placement_.T_ned_map * s->T_map_body.p - ned).norm(), 1e-9);
  EXPECT_EQ(fusion_.start_position_sigma_m, 1.5);
}

TEST_F(StartByGps, SaysWhatIsWrong) {
  for (const char* words : {"gps:", "gps:1,2", "gps:1,2,3,4,5", "gps:91,0,0", "gps:1,2,3,", "gps:1,2,3,0",
                            "gps:a,b,c", "gps:1 2 3", "gps:nan,2,3"})
    EXPECT_FALSE(start(words)) << words;
  placement_.origin_llh.reset();
  EXPECT_NE(start("gps:47.4,8.5,412").error().line().find("not placed"), std::string::npos);
  recording_.has_imu = false;
  EXPECT_NE(start("gps:47.4,8.5,412").error().line().find("no IMU"), std::string::npos);
}

TEST(KeptPlaces, ThoseOfAMapThatWasChangedAreToldAndNotUsed) {
  const TemporaryFolder folder;
  const std::string path = folder / "map.h5";
  ASSERT_TRUE(write_map_h5(path, box(8)).ok());
  const ContourMap map = read_map_h5(path).value();
  std::vector<Error> findings;
  const auto none = kept_places(path, map, findings);
  EXPECT_TRUE(none.ok() && !*none);
  const PlaceTable places{
      view_fingerprint(map),     0.1,  40, 0.17, {Eigen::Vector3d(0, 1, 2), Eigen::Vector3d(3, 4, 5)},
      {4, PlaceTable::kNoPlace}, {0xA}};
  ASSERT_TRUE(write_map_h5(path, map, "", {}, &places).ok());
  const auto kept = kept_places(path, map, findings);
  EXPECT_TRUE(kept.ok() && *kept);
  EXPECT_TRUE(findings.empty());
  ContourMap changed = map;
  changed.points.front().position.x() += 0.01F;
  const auto of_before = kept_places(path, changed, findings);
  EXPECT_TRUE(of_before.ok() && !*of_before);
  ASSERT_EQ(findings.size(), 1U);
  EXPECT_EQ(findings[0].where, path);
  EXPECT_NE(findings[0].what.find("before it was changed"), std::string::npos);
  EXPECT_NE(findings[0].fix.find("evpose map index"), std::string::npos);
}

}  // namespace
}  // namespace evpose
