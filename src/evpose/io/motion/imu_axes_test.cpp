// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/motion/imu_axes.h"

#include <gtest/gtest.h>

#include <array>
#include <numbers>

#include "evpose/io/files/test_files.h"
#include "evpose/io/motion/imu_csv.h"
#include "evpose/io/motion/imu_text.h"
#include "evpose/io/motion/trajectory.h"

namespace evpose {
namespace {

/// A body that turns about all axes, by large angles unless slowed down, and swings by decimetres.
struct Flight {
  std::vector<ImuSample> imu;
  std::vector<TimedPose> truth;
};

Flight turning_flight(double slower = 1) {
  Flight out;
  Eigen::Quaterniond q = Eigen::Quaterniond::Identity();
  for (int i = 0; i <= 8000; ++i) {
    const double t = 1e-3 * i;
    const Eigen::Vector3d rate =
        slower *
        Eigen::Vector3d(1.1 * std::sin(1.3 * t + 0.3), 0.9 * std::cos(1.1 * t), 0.7 * std::sin(0.9 * t + 1));
    const Eigen::Vector3d p(0.3 * std::sin(2 * t), 0.2 * std::sin(3 * t), 0.1 * std::cos(2 * t));
    const Eigen::Vector3d a(-1.2 * std::sin(2 * t), -1.8 * std::sin(3 * t), -0.4 * std::cos(2 * t));
    out.imu.push_back({i * kNsPerMs, rate, q.conjugate() * (a + Eigen::Vector3d(0, 0, 9.81))});
    if (i % 10 == 0) out.truth.push_back({i * kNsPerMs, {q, p}});
    q = (q * so3::exp(1e-3 * rate)).normalized();
  }
  return out;
}

std::vector<AxisNames> every_axis_names() {
  std::vector<AxisNames> out;
  std::array<int, 3> order{0, 1, 2};
  do {
    for (int signs = 0; signs < 8; ++signs) {
      AxisNames names = AxisNames::Zero();
      for (int i = 0; i < 3; ++i)
        names(i, order[static_cast<std::size_t>(i)]) = (signs >> i & 1) != 0 ? -1 : 1;
      out.push_back(names);
    }
  } while (std::next_permutation(order.begin(), order.end()));
  return out;
}

TEST(ImuAxes, WordsNameTheTrueAxesByThoseRead) {
  AxisNames names;
  names << 0, 1, 0, -1, 0, 0, 0, 0, 1;
  EXPECT_EQ(in_words(names), "x were y, y were -x, z were z");
}

TEST(ImuAxes, ATrueImuIsNotDoubted) {
  const Flight flight = turning_flight();
  EXPECT_FALSE(doubt_gyro_by_gravity(flight.imu, "imu.csv"));
  EXPECT_FALSE(doubt_imu_scales(flight.imu, "imu.csv"));
  EXPECT_TRUE(doubt_axes_against(flight.truth, flight.imu, "imu.csv").empty());
}

TEST(ImuAxes, AnyOtherNamingOfTheGyroscopesAxesIsFound) {
  const Flight flight = turning_flight();
  int told_by_gravity = 0;  // which some exchanges hardly move
  for (const AxisNames& names : every_axis_names()) {
    if (names.isIdentity()) continue;
    auto read = flight.imu;
    for (ImuSample& s : read) s.gyro = names.transpose() * s.gyro;
    const auto by_gravity = doubt_gyro_by_gravity(read, "imu.csv");
    told_by_gravity += by_gravity ? 1 : 0;
    EXPECT_TRUE(!by_gravity || says(by_gravity->line(), {"gyroscope", "gravity", in_words(names).c_str()}))
        << by_gravity->line();
    const auto by_truth = doubt_axes_against(flight.truth, read, "imu.csv");
    ASSERT_EQ(by_truth.size(), 1u) << in_words(names);
    EXPECT_TRUE(says(by_truth[0].line(), {"gyroscope", "ground truth", in_words(names).c_str()}))
        << by_truth[0].line();
  }
  EXPECT_GE(told_by_gravity, 40);
}

TEST(ImuAxes, GentleTurnsAreEnoughBesideAGroundTruth) {
  const Flight flight = turning_flight(0.1);  // 6 deg/s on the whole
  AxisNames names;
  names << 0, 1, 0, 1, 0, 0, 0, 0, 1;
  EXPECT_TRUE(doubt_axes_against(flight.truth, flight.imu, "imu.csv").empty());
  auto read = flight.imu;
  for (ImuSample& s : read) s.gyro = names.transpose() * s.gyro;
  const auto doubts = doubt_axes_against(flight.truth, read, "imu.csv");
  ASSERT_EQ(doubts.size(), 1u);
  EXPECT_TRUE(says(doubts[0].line(), {"gyroscope", in_words(names).c_str()})) << doubts[0].line();
}

TEST(ImuAxes, AnyOtherNamingOfTheAccelerometersAxesIsFoundByTheGroundTruth) {
  const Flight flight = turning_flight();
  for (const AxisNames& names : every_axis_names()) {
    if (names.isIdentity()) continue;
    auto read = flight.imu;
    for (ImuSample& s : read) s.accel = names.transpose() * s.accel;
    const auto doubts = doubt_axes_against(flight.truth, read, "imu.csv");
    ASSERT_EQ(doubts.size(), 1u) << in_words(names);
    EXPECT_TRUE(says(doubts[0].line(), {"accelerometer", in_words(names).c_str()})) << doubts[0].line();
  }
}

TEST(ImuAxes, DegreesAreFoundByGravityAlone) {
  auto read = turning_flight(0.1).imu;  // 6 deg/s on the whole
  for (ImuSample& s : read) s.gyro *= 180 / std::numbers::pi;
  const auto doubt = doubt_gyro_by_gravity(read, "imu.csv");
  ASSERT_TRUE(doubt);
  EXPECT_TRUE(says(doubt->line(), {"deg/s", "imu.gyro_unit: deg/s"}));
}

/// A camera that looks level and ahead on a body with x forward and z up, which hardly turns.
TEST(ImuAxes, GravityTellsWhenTheCameraLiesOnItsSideOrHead) {
  Eigen::Matrix3d ahead;
  ahead << 0, -1, 0, 0, 0, -1, 1, 0, 0;
  const auto flight = turning_flight(0.05);
  EXPECT_FALSE(doubt_camera_roll(flight.imu, ahead, "imu.csv"));
  for (const AxisNames& names : every_axis_names()) {
    std::vector<ImuSample> read = flight.imu;
    for (ImuSample& s : read) s.accel = names * s.accel, s.gyro = names * s.gyro;
    const Eigen::Vector3d up = names.col(2);  // as read
    EXPECT_EQ(doubt_camera_roll(read, ahead, "imu.csv").has_value(), up.y() != 0 || up.z() < 0) << names;
  }
}

TEST(ImuAxes, OtherUnitsOfForceAndTimeAreDoubted) {
  const auto doubt = [](double force, double time) {
    auto read = turning_flight().imu;
    for (ImuSample& s : read) {
      s.accel *= force;
      s.t = static_cast<TimeNs>(static_cast<double>(s.t) * time);
    }
    const auto found = doubt_imu_scales(read, "imu.csv");
    return found ? found->line() : "";
  };
  EXPECT_EQ(doubt(1, 1), "");
  EXPECT_TRUE(says(doubt(100, 1), {"another unit", "imu.accel_unit"}));  // cm/s^2
  EXPECT_TRUE(says(doubt(3.28, 1), {"another unit"}));                   // ft/s^2
  EXPECT_TRUE(says(doubt(1, 1e-3), {"another unit", "imu.time_unit"}));  // us read as ns
  EXPECT_TRUE(says(doubt(1, 1e3), {"another unit", "imu.time_unit"}));   // ns read as us
}

TEST(ImuAxes, TooLittleTellsNothing) {
  const Flight flight = turning_flight();
  for (const std::size_t count : {0u, 1u, 9u, 300u}) {
    const std::vector<ImuSample> few(flight.imu.begin(),
                                     flight.imu.begin() + static_cast<std::ptrdiff_t>(count));
    EXPECT_FALSE(doubt_gyro_by_gravity(few, "imu.csv"));
    EXPECT_TRUE(doubt_axes_against(flight.truth, few, "imu.csv").empty());
  }
  EXPECT_TRUE(doubt_axes_against({}, flight.imu, "imu.csv").empty());
  auto elsewhere = flight.truth;
  for (TimedPose& pose : elsewhere) pose.t += 100 * kNsPerS;
  EXPECT_TRUE(doubt_axes_against(elsewhere, flight.imu, "imu.csv").empty());
}

/// Flights with drones, and one by hand, of other people: as published, and with the axes of the gyroscope
/// mixed up.
TEST(ImuAxes, RealFlightsAreNotDoubtedUntilTheirAxesAreMixedUp) {
  const std::string data = shared_folder() + "/data/real/drone_imu_mocap/";
  EVPOSE_NEEDS_SHARED(data);
  AxisNames mixed;
  mixed << 0, 1, 0, 0, 0, -1, 1, 0, 0;
  for (const char* name : {"euroc_v1_02_medium", "blackbird_clover_5mps_a", "blackbird_clover_5mps_b"}) {
    const std::string path = data + name + "/imu.csv";
    auto options = recognise_imu_text(path);
    ASSERT_TRUE(options) << error_line(options);
    auto samples = read_imu_csv(path, *options);
    ASSERT_TRUE(samples) << error_line(samples);
    EXPECT_FALSE(doubt_gyro_by_gravity(*samples, path)) << doubt_gyro_by_gravity(*samples, path)->line();
    EXPECT_FALSE(doubt_imu_scales(*samples, path));
    const auto truth = read_trajectory(data + name + "/groundtruth.csv");
    ASSERT_TRUE(truth) << error_line(truth);
    for (const Error& doubt : doubt_axes_against(*truth, *samples, path)) ADD_FAILURE() << doubt.line();
    for (ImuSample& s : *samples) s.gyro = mixed.transpose() * s.gyro;
    const auto doubts = doubt_axes_against(*truth, *samples, path);
    ASSERT_EQ(doubts.size(), 1u) << path;
    EXPECT_TRUE(says(doubts[0].line(), {"gyroscope", in_words(mixed).c_str()})) << doubts[0].line();
  }
}

}  // namespace
}  // namespace evpose
