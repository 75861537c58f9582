// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/motion/trajectory.h"

#include <gtest/gtest.h>

#include "evpose/io/files/test_files.h"
#include "evpose/io/motion/imu_text.h"
#include "evpose/io/motion/trajectory_tum.h"

namespace evpose {
namespace {

std::vector<TimedPose> curve(int count) {
  std::vector<TimedPose> out;
  for (int i = 0; i < count; ++i) {
    const double s = 0.37 * i;
    TimedPose row;
    row.t = 1'700'000'000'123'456'789 + i * 8'333'333LL;
    row.pose.p = {std::cos(s), 2 * std::sin(s), -0.1 * s};
    row.pose.q = so3::exp({0.3 * s, -0.2, 0.1 * s * s});
    out.push_back(row);
  }
  return out;
}

void expect_same(const std::vector<TimedPose>& a, const std::vector<TimedPose>& b, double tolerance) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].t, b[i].t);
    EXPECT_LT(a[i].pose.minus(b[i].pose).norm(), tolerance) << i;
  }
}

TEST(Trajectory, EurocComesBackAsWritten) {
  const TemporaryFolder folder;
  const auto written = curve(50);
  ASSERT_TRUE(write_euroc(folder / "a.csv", written).ok());
  const auto read = read_trajectory(folder / "a.csv");
  ASSERT_TRUE(read.ok()) << error_line(read);
  expect_same(*read, written, 5e-9);
}

TEST(Trajectory, EurocTruthOfSeventeenColumnsHasItsScalarFirst) {
  const TemporaryFolder folder;
  const auto path =
      folder.file("data.csv",
                  "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x []\n"
                  "1403636580838555648,4.688,-1.786,0.783,0.6,-0.8,0,0,1,2,3,4,5,6,7,8,9\n"
                  "1403636580843555328, 4.689, -1.787, 0.784, 0.6, -0.8, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9\n");
  const auto read = read_trajectory(path);
  ASSERT_TRUE(read.ok()) << error_line(read);
  ASSERT_EQ(read->size(), 2u);
  EXPECT_EQ(read->front().t, 1403636580838555648);
  EXPECT_EQ(read->front().pose.p, Eigen::Vector3d(4.688, -1.786, 0.783));
  EXPECT_NEAR(read->back().pose.q.w(), 0.6, 1e-15);
  EXPECT_NEAR(read->back().pose.q.x(), -0.8, 1e-15);
}

TEST(Trajectory, CsvInSecondsOrWithAHeadingThatSaysSoHasItsScalarLast) {
  const TemporaryFolder folder;
  const auto seconds =
      folder.file("a.csv",
                  "#t[s],px[m],py,pz,qx,qy,qz,qw,vx[m/s]\n"
                  "1525745865.001655,1,2,3,-0.8,0,0,0.6,9\n1525745865.011655,1,2,3,-0.8,0,0,0.6,9\n");
  const auto nanoseconds =
      folder.file("b.csv",
                  "#timestamp [ns], p_x [m], p_y [m], p_z [m], q_x [], q_y [], q_z [], q_w []\n"
                  "1525745865001655000,1,2,3,-0.8,0,0,0.6\n1525745865011655000,1,2,3,-0.8,0,0,0.6\n");
  for (const auto& path : {seconds, nanoseconds}) {
    const auto read = read_trajectory(path);
    ASSERT_TRUE(read.ok()) << error_line(read);
    ASSERT_EQ(read->size(), 2u);
    EXPECT_EQ(read->back().t, 1'525'745'865'011'655'000);
    EXPECT_NEAR(read->back().pose.q.w(), 0.6, 1e-15);
    EXPECT_NEAR(read->back().pose.q.x(), -0.8, 1e-15);
  }
}

TEST(Trajectory, TumIsRecognised) {
  const TemporaryFolder folder;
  const auto written = curve(20);
  ASSERT_TRUE(write_tum(folder / "a.txt", written).ok());
  const auto read = read_trajectory(folder / "a.txt");
  ASSERT_TRUE(read.ok()) << error_line(read);
  expect_same(*read, written, 5e-9);
}

TEST(Trajectory, MotionCaptureOfTumVieIsInMicroseconds) {
  const TemporaryFolder folder;
  const auto path = folder.file("mocap_data.txt",
                                "# timestamp(us) px py pz qx qy qz qw\n"
                                "1025017.125 1 2 3 0 0 0 1\n"
                                "1033350.25 1 2 3.5 0.6 0 0 0.8\n");
  const auto read = read_trajectory(path);
  ASSERT_TRUE(read.ok()) << error_line(read);
  EXPECT_EQ(read->front().t, 1'025'017'125);
  EXPECT_EQ(read->back().t, 1'033'350'250);
  EXPECT_NEAR(read->back().pose.q.x(), 0.6, 1e-15);
}

TEST(Trajectory, KittiIsMatricesWithTimesBeside) {
  const TemporaryFolder folder;
  const auto path = folder.file("00.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n0 -1 0 5 1 0 0 6 0 0 1 7\n");
  EXPECT_TRUE(says(error_line(read_trajectory(path)), {"00.txt", "without stamps", "times.txt"}));
  folder.file("times.txt", "0.000000e+00\n1.036200e-01\n");
  const auto read = read_trajectory(path);
  ASSERT_TRUE(read.ok()) << error_line(read);
  EXPECT_EQ(read->back().t, 103'620'000);
  EXPECT_EQ(read->back().pose.p, Eigen::Vector3d(5, 6, 7));
  // A quarter turn about z takes x to y.
  EXPECT_LT((read->back().pose.q * Eigen::Vector3d::UnitX() - Eigen::Vector3d::UnitY()).norm(), 1e-12);
  folder.file("times.txt", "0\n0.1\n0.2\n");
  EXPECT_TRUE(says(error_line(read_trajectory(path)), {"2 poses", "3 stamps"}));
  folder.file("times.txt", "0\n");
  EXPECT_TRUE(says(error_line(read_trajectory(path)), {"00.txt:2", "1 stamps"}));
  folder.file("bad.txt", "2 0 0 0 0 1 0 0 0 0 1 0\n");
  EXPECT_TRUE(says(error_line(read_trajectory(folder / "bad.txt")), {"bad.txt:1", "no rotation"}));
}

TEST(Trajectory, FaultsNameTheirLine) {
  const TemporaryFolder folder;
  const auto fault = [&](const char* content) {
    return error_line(read_trajectory(folder.file("f.csv", content)));
  };
  EXPECT_TRUE(says(fault("1,2,3\n"), {"f.csv:1", "3 values"}));
  EXPECT_TRUE(says(fault("1.5,0,0,0,1,0,0,0\n1,0,0,0,1,0,0,0\n"), {"f.csv:2", "does not come after"}));
  EXPECT_TRUE(says(fault("5,0,0,0,1,0,0,0\n6,0,nan,0,1,0,0,0\n"), {"f.csv:2", "finite"}));
  EXPECT_TRUE(says(fault(""), {"f.csv", "no poses"}));
  EXPECT_TRUE(says(error_line(read_trajectory(folder / "none")), {"none", "no such file"}));
}

std::vector<ImuSample> read_imu(const std::string& path) {
  const auto options = recognise_imu_text(path);
  EXPECT_TRUE(options.ok()) << error_line(options);
  if (!options) return {};
  const auto samples = read_imu_csv(path, *options);
  EXPECT_TRUE(samples.ok()) << error_line(samples);
  return samples.ok() ? *samples : std::vector<ImuSample>{};
}

struct ImuLayout {
  const char* name;
  const char* content;
  TimeNs second;
};

/// The same two samples in each layout.
class ImuText : public ::testing::TestWithParam<ImuLayout> {};

TEST_P(ImuText, IsReadAsItsPublishersMeanIt) {
  const TemporaryFolder folder;
  const auto samples = read_imu(folder.file("imu.txt", GetParam().content));
  ASSERT_EQ(samples.size(), 2u);
  EXPECT_EQ(samples[1].t, GetParam().second);
  EXPECT_EQ(samples[1].gyro, Eigen::Vector3d(0.1, -0.2, 0.3));
  EXPECT_EQ(samples[1].accel, Eigen::Vector3d(1.5, -9.5, 0.25));
}

INSTANTIATE_TEST_SUITE_P(
    Layouts, ImuText,
    ::testing::Values(
        ImuLayout{"TumVie",
                  "# timestamp[us] gx gy gz ax ay az temperature\n"
                  "5000.5 0 0 0 0 -9.8 0 31.5\n10000.75 0.1 -0.2 0.3 1.5 -9.5 0.25 31.5\n",
                  10'000'750},
        ImuLayout{"VECtor",
                  "# IMU\n# t gx gy gz ax ay az qx qy qz qw\n"
                  "1642661135.001 0 0 0 0 -9.8 0 0 0 0 1\n"
                  "1642661135.006 0.1 -0.2 0.3 1.5 -9.5 0.25 0 0 0 1\n",
                  1'642'661'135'006'000'000},
        ImuLayout{
            "Euroc",
            "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],a_RS_S_x [m s^-2]\n"
            "1403636579758555392,0,0,0,0,-9.8,0\n1403636579763555392,0.1,-0.2,0.3,1.5,-9.5,0.25\n",
            1'403'636'579'763'555'392},
        ImuLayout{"EventCameraDataset", "0.001 0 -9.8 0 0 0 0\n0.002 1.5 -9.5 0.25 0.1 -0.2 0.3\n",
                  2'000'000}),
    [](const auto& layout) { return std::string(layout.param.name); });

TEST(ImuText, WithoutGravityIsRefused) {
  const TemporaryFolder folder;
  const auto path = folder.file("imu.txt", "1 0 0 0 0 0 1\n2 0 0 0 0 0 1\n");
  EXPECT_TRUE(says(error_line(recognise_imu_text(path)), {"imu.txt", "9.81", "imu.columns"}));
  EXPECT_TRUE(says(error_line(recognise_imu_text(folder.file("b", "1 2 3\n"))), {"b:1", "3 values"}));
}

}  // namespace
}  // namespace evpose
