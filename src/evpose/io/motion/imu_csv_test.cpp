// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/motion/imu_csv.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "evpose/io/files/test_files.h"
#include "evpose/io/motion/imu_units.h"

namespace evpose {
namespace {

const std::string kHeader = "#timestamp_ns,wx,wy,wz,ax,ay,az\n";

std::vector<ImuSample> at_rest(int count, double rate = 0) {
  std::vector<ImuSample> samples;
  for (int i = 0; i < count; ++i)
    samples.push_back({i * kNsPerMs, {rate, -0.5 * rate, 0.123456789}, {0.1, -0.2, 9.80665}});
  return samples;
}

TEST(ImuCsv, WrittenSamplesReadBack) {
  const TemporaryFolder folder;
  auto samples = at_rest(100, 0.3);
  for (auto& s : samples) s.t += 1'700'000'000'123'456'789;
  ASSERT_TRUE(write_imu_csv(folder / "imu.csv", samples).ok());
  const auto again = read_imu_csv(folder / "imu.csv");
  ASSERT_TRUE(again.ok()) << error_line(again);
  ASSERT_EQ(again->size(), samples.size());
  for (std::size_t i = 0; i < samples.size(); ++i) {
    EXPECT_EQ((*again)[i].t, samples[i].t);
    EXPECT_LT(((*again)[i].gyro - samples[i].gyro).norm(), 1e-9);
    EXPECT_LT(((*again)[i].accel - samples[i].accel).norm(), 1e-9);
  }
}

TEST(ImuCsv, UnitsAndColumnsAsStated) {
  const TemporaryFolder folder;
  ImuReadOptions options;
  options.time_unit = "s";
  options.gyro_in_degrees = options.accel_in_g = true;
  options.columns = {"timestamp_ns", "temperature", "ax", "ay", "az", "wx", "wy", "wz"};
  const auto samples = read_imu_csv(
      folder.file("imu.csv", "#any heading\r\n1.5, 20, 0, 0, 1, 180, 0, 0\r\n1.501,20,0,0,1,0,0,0"), options);
  ASSERT_TRUE(samples.ok()) << error_line(samples);
  ASSERT_EQ(samples->size(), 2u);
  EXPECT_EQ((*samples)[0].t, 1'500'000'000);
  EXPECT_DOUBLE_EQ((*samples)[0].gyro.x(), std::numbers::pi);
  EXPECT_DOUBLE_EQ((*samples)[0].accel.z(), 9.80665);
}

TEST(ImuCsv, ErrorsNameTheLine) {
  const TemporaryFolder folder;
  const auto line = [&](const std::string& content) {
    return error_line(read_imu_csv(folder.file("imu.csv", content)));
  };
  const std::string row = "0,0,0,0,0,0,9.8\n";
  EXPECT_TRUE(says(line(""), {"imu.csv", "empty"}));
  EXPECT_TRUE(says(line(row), {"imu.csv:1", "#timestamp_ns", "imu.columns"}));
  EXPECT_TRUE(says(line(kHeader + row + "1000,0,0,0\n"), {"imu.csv:3", "4 values instead of 7"}));
  EXPECT_TRUE(says(line(kHeader + row + "1000,0,0,nan,0,0,9.8\n"), {"imu.csv:3", "wz", "nan"}));
  EXPECT_TRUE(says(line(kHeader + row + "1000,0,0,0,0,0,9.8x\n"), {"imu.csv:3", "az", "9.8x"}));
  EXPECT_TRUE(says(line(kHeader + row + "1.5,0,0,0,0,0,9.8\n" + "1.2,0,0,0,0,0,9.8\n"),
                   {"imu.csv:4", "stands twice"}));
  EXPECT_TRUE(says(line(kHeader + "5000,0,0,0,0,0,9.8\n4000,0,0,0,0,0,9.8\n"), {"imu.csv:3", "goes back"}));
  EXPECT_TRUE(says(line(kHeader + row + "130000000,0,0,0,0,0,9.8\n"), {"imu.csv:3", "gap of 0.13 s"}));
  EXPECT_TRUE(says(line(kHeader + "9223372036854775807,0,0,0,0,0,9.8\n"), {"imu.csv:2", "imu.time_unit"}));
  EXPECT_TRUE(says(error_line(read_imu_csv(folder / "none.csv")), {"none.csv", "no such file"}));
}

TEST(ImuCsv, GapsOutsideOfTheCropDoNotMatter) {
  const TemporaryFolder folder;
  const std::string path = folder.file("imu.csv", kHeader + "0,0,0,0,0,0,9.8\n2000000000,0,0,0,0,0,9.8\n" +
                                                      "2040000000,0,0,0,0,0,9.8\n9000000000,0,0,0,0,0,nan\n");
  ImuReadOptions options;
  options.t_start_ns = 2'000'000'000;
  options.t_end_ns = 2'040'000'000;
  EXPECT_TRUE(says(error_line(read_imu_csv(path, options)), {"imu.csv:5"}));
  const std::string sound =
      folder.file("imu.csv", kHeader + "0,0,0,0,0,0,9.8\n2000000000,0,0,0,0,0,9.8\n" +
                                 "2040000000,0,0,0,0,0,9.8\n9000000000,0,0,0,0,0,9.8\n");
  EXPECT_EQ(read_imu_csv(sound, options).value().size(), 2u);
}

TEST(ImuCsv, TruncationAnywhereIsAnswered) {
  const TemporaryFolder folder;
  ASSERT_TRUE(write_imu_csv(folder / "whole.csv", at_rest(5)).ok());
  const std::string whole = content_of(folder / "whole.csv");
  for (std::size_t n = 0; n < whole.size(); ++n) {
    const std::string path = folder.file("imu.csv", whole.substr(0, n));
    expect_no_harm(read_imu_csv(path), path, n);
  }
}

TEST(ImuUnits, AccelerometerInGIsTold) {
  auto samples = at_rest(1000);
  EXPECT_TRUE(check_imu_units(samples, "imu.csv").ok());
  for (auto& s : samples) s.accel /= 9.80665;
  EXPECT_TRUE(says(error_line(check_imu_units(samples, "imu.csv")), {"imu.csv", " g,", "imu.accel_unit: g"}));
  for (auto& s : samples) s.accel *= 0.1;
  EXPECT_TRUE(says(error_line(check_imu_units(samples, "imu.csv")), {"gravity"}));
}

TEST(ImuUnits, ImplausibleRatesAreDegrees) {
  EXPECT_TRUE(check_imu_units(at_rest(1000, 6), "imu.csv").ok());  // a fast flip is none
  EXPECT_TRUE(
      says(error_line(check_imu_units(at_rest(1000, 60), "imu.csv")), {"deg/s", "imu.gyro_unit: deg/s"}));
}

TEST(ImuUnits, SlowDegreesAreToldByTheGroundTruth) {
  std::vector<ImuSample> samples;
  std::vector<TimedPose> truth;
  const auto rate = [](double t) { return 0.2 * std::sin(t); };  // rad/s, 11 deg/s at most
  Eigen::Quaterniond q = Eigen::Quaterniond::Identity();
  for (int i = 0; i < 5000; ++i) {
    samples.push_back({i * kNsPerMs, {0, 0, rate(i * 1e-3)}, {0, 0, 9.81}});
    if (i % 10 == 0) truth.push_back({i * kNsPerMs, {q, Eigen::Vector3d::Zero()}});
    q = q * so3::exp({0, 0, rate(i * 1e-3) * 1e-3});
  }
  EXPECT_TRUE(check_gyro_against(truth, samples, "imu.csv").ok());
  for (auto& s : samples) s.gyro *= 180 / std::numbers::pi;
  EXPECT_TRUE(check_imu_units(samples, "imu.csv").ok());
  EXPECT_TRUE(says(error_line(check_gyro_against(truth, samples, "imu.csv")), {"imu.gyro_unit: deg/s"}));
  for (auto& s : samples) s.gyro *= 0.5;  // neither fits: nothing is claimed
  EXPECT_TRUE(check_gyro_against(truth, samples, "imu.csv").ok());
  EXPECT_TRUE(check_gyro_against({}, samples, "imu.csv").ok());
}

}  // namespace
}  // namespace evpose
