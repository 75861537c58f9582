// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/sensors/lidar.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "evpose/core/config.h"
#include "evpose/core/parallel.h"
#include "evpose/io/files/test_files.h"
#include "evpose/sim/light/test_scene.h"

namespace evpose::sim {
namespace {

using Eigen::Vector3d;
constexpr double kDegree = std::numbers::pi / 180;

Trajectory standing(double duration_s, const Vector3d& place = Vector3d::Zero()) {
  return {PoseSpline(0.1, {Pose{Eigen::Quaterniond::Identity(), place}}), {}, duration_s};
}

// No mounting angle; no faults but what the test sets.
LidarConfig level() {
  LidarConfig c;
  c.mount_pitch_deg = c.range_sigma_m = c.mixed_m = 0;
  c.keep_every = 1;
  c.down_deg = -30;
  c.up_deg = 30;
  return c;
}

// A wall across +x.
TestScene wall(double distance) {
  TestScene test;
  test.add({distance, -100, -100}, {0, 200, 0}, {0, 0, 200}, 0.4);
  return test;
}

std::vector<CloudPoint> all_scans(const Lidar& lidar) {
  std::vector<CloudPoint> all;
  for (int i = 0; i < lidar.scans(); ++i) {
    const auto scan = lidar.scan(i);
    all.insert(all.end(), scan.begin(), scan.end());
  }
  return all;
}

TEST(Lidar, RangeNoiseToAWallIsAsGiven) {
  const TestScene test = wall(5);
  const RayCaster look(test.scene);
  const Trajectory trajectory = standing(1);
  LidarConfig c = level();
  c.range_sigma_m = 0.015;
  double sum = 0, squares = 0, count = 0;
  for (const CloudPoint& point : all_scans(Lidar(look, trajectory, c, 1))) {
    const Vector3d p = point.position.cast<double>();
    const double error = p.norm() - 5 * p.norm() / p.x();
    sum += error, squares += error * error, ++count;
    EXPECT_EQ(point.intensity, 102);  // 0.4 * 255
  }
  ASSERT_GT(count, 50000);
  EXPECT_NEAR(sum / count, 0, 4 * 0.015 / std::sqrt(count));
  EXPECT_NEAR(std::sqrt(squares / count), 0.015, 0.05 * 0.015);
}

TEST(Lidar, PatternCoversTheFieldOfViewAndDoesNotRepeat) {
  LidarConfig c;
  const auto cells = [&](double start_s, double end_s, double cell_deg) {
    std::set<std::pair<int, int>> seen;
    for (double t = start_s; t < end_s; t += 1 / c.points_per_s) {
      const Vector3d beam = lidar_beam(c, t);
      EXPECT_NEAR(beam.norm(), 1, 1e-12);
      const double azimuth = std::atan2(beam.y(), beam.x()) / kDegree,
                   elevation = std::asin(beam.z()) / kDegree;
      EXPECT_GE(elevation, c.down_deg - 1e-9);
      EXPECT_LE(elevation, c.up_deg + 1e-9);
      seen.emplace(static_cast<int>((azimuth + 180) / cell_deg),
                   static_cast<int>((elevation + 7) / cell_deg));
    }
    return seen.size();
  };
  EXPECT_EQ(cells(0, 1, 2), 180u * 30u);  // 29.5 rows of 2 degrees
  const double fine_cells = 360 * 59 / 0.25;
  const auto tenth = static_cast<double>(cells(0, 0.1, 0.5)), second = static_cast<double>(cells(0, 1, 0.5));
  EXPECT_LT(tenth, 0.25 * fine_cells);
  EXPECT_GT(second, 0.85 * fine_cells);
}

TEST(Lidar, NothingBeyondTheRangesOrTooFlat) {
  const TestScene test = wall(3);
  const RayCaster look(test.scene);
  const Trajectory trajectory = standing(0.5);
  LidarConfig c = level();
  c.range_sigma_m = 0.02;
  c.range_min_m = 3.1;
  c.range_max_m = 6;
  const auto near = all_scans(Lidar(look, trajectory, c, 1));
  ASSERT_GT(near.size(), 1000u);
  for (const CloudPoint& p : near) {
    EXPECT_LE(p.position.norm(), 6 + 1e-5);
    EXPECT_GE(p.position.norm(), 3.1 - 1e-5);
  }
  c.range_max_m = 1000;
  c.max_incidence_deg = 50;
  for (const CloudPoint& p : all_scans(Lidar(look, trajectory, c, 1)))
    EXPECT_GE(p.position.x() / p.position.norm(), std::cos(50 * kDegree) - 1e-6);
}

TEST(Lidar, PointsAtAnEdgeAreDrawnTowardsTheOtherSideByNoMoreThanGiven) {
  TestScene test = wall(6);
  test.add({4, 0, -100}, {0, 100, 0}, {0, 0, 200}, 0.4);  // the left half stands 2 m nearer
  const RayCaster look(test.scene);
  const Trajectory trajectory = standing(2);
  LidarConfig c = level();
  c.beam_deg = 1;  // wide, for many such points
  c.mixed_m = 0.03;
  c.down_deg = -3;
  c.up_deg = 3;
  c.max_incidence_deg = 30;
  int mixed = 0;
  for (const CloudPoint& point : all_scans(Lidar(look, trajectory, c, 1))) {
    const Vector3d p = point.position.cast<double>();
    const double plane = p.x() > 5 ? 6 : 4;
    const double error = p.norm() - plane * p.norm() / p.x();
    EXPECT_LE(std::abs(error), 0.03 + 1e-5);
    const double angle = std::abs(std::atan2(p.y(), p.x()));
    if (std::abs(error) > 0.029) {
      ++mixed;
      EXPECT_LT(angle, 0.55 * kDegree);
      EXPECT_EQ(error < 0, plane == 6);
    } else if (angle > 0.55 * kDegree) {
      EXPECT_LT(std::abs(error), 3e-3);  // of the slanted beam itself
    }
  }
  EXPECT_GT(mixed, 50);
}

TEST(Lidar, RegistrationErrorIsOneRigidMotionPerScanOfTheGivenSize) {
  const TestScene test = wall(5);
  const RayCaster look(test.scene);
  const Trajectory trajectory = standing(20, {1, 2, 3});
  LidarConfig c = level();
  c.points_per_s = 2000;
  const Lidar exact(look, trajectory, c, 3);
  c.registration_m = 0.02;
  const Lidar shifted(look, trajectory, c, 3);
  double squares = 0;
  for (int i = 0; i < exact.scans(); ++i) {
    const auto a = exact.scan(i), b = shifted.scan(i);
    ASSERT_EQ(a.size(), b.size());
    ASSERT_FALSE(a.empty());
    const Eigen::Vector3f shift = b[0].position - a[0].position;
    for (std::size_t k = 0; k < a.size(); ++k) {
      EXPECT_LT((b[k].position - a[k].position - shift).norm(), 1e-4);
      EXPECT_EQ(a[k].scan, i);
    }
    squares += shift.squaredNorm();
  }
  EXPECT_NEAR(std::sqrt(squares / (3 * exact.scans())), 0.02, 0.003);
  c.registration_m = 0;
  c.registration_deg = 1;
  const Lidar turned(look, trajectory, c, 3);
  const auto a = exact.scan(5), b = turned.scan(5);
  for (std::size_t k = 0; k < a.size(); ++k)  // about the sensor
    EXPECT_NEAR((a[k].position - Eigen::Vector3f(1, 2, 3)).norm(),
                (b[k].position - Eigen::Vector3f(1, 2, 3)).norm(), 1e-4);
  EXPECT_GT((a[0].position - b[0].position).norm(), 0.01);
}

TEST(Lidar, CloudFileIsTheSameForAnyThreadsAndReadsBack) {
  const TestScene test = wall(5);
  const RayCaster look(test.scene);
  const TemporaryFolder folder;
  LidarConfig c;
  c.on = true;
  c.flight.duration_s = 1;
  c.flight.centre_x_m = 2;
  c.points_per_s = 20000;
  ThreadPool one(1), three(3);
  ASSERT_TRUE(write_lidar(folder / "a.ply", look, c, 7, one).ok());
  ASSERT_TRUE(write_lidar(folder / "b.ply", look, c, 7, three).ok());
  EXPECT_EQ(content_of(folder / "a.ply"), content_of(folder / "b.ply"));
  const auto table = read_ply_vertices(folder / "a.ply");
  ASSERT_TRUE(table.ok()) << error_line(table);
  EXPECT_EQ(table->names, (std::vector<std::string>{"x", "y", "z", "intensity", "scan"}));
  ASSERT_GT(table->rows(), 500u);
  EXPECT_EQ(table->columns[4].back(), 9);
  EXPECT_EQ(table->columns[3].front(), 102);
  c.on = false;
  ASSERT_TRUE(write_lidar(folder / "c.ply", look, c, 7, one).ok());
  EXPECT_EQ(folder.entries(), 2u);
}

TEST(Lidar, TooManyPointsAreRefused) {
  const TestScene test = wall(5);
  const RayCaster look(test.scene);
  const TemporaryFolder folder;
  ThreadPool pool(1);
  LidarConfig c;
  c.on = true;
  c.points_per_s = 1e7;
  c.keep_every = 1;
  EXPECT_TRUE(says(error_line(write_lidar(folder / "a.ply", look, c, 1, pool)), {"lidar", "too many"}));
  c = LidarConfig();
  c.on = true;
  c.scan_s = 1e-4;
  EXPECT_TRUE(
      says(error_line(write_lidar(folder / "a.ply", look, c, 1, pool)), {"lidar.scan_s", "too many"}));
  c = LidarConfig();
  c.on = true;
  c.up_deg = c.down_deg;
  EXPECT_TRUE(says(error_line(write_lidar(folder / "a.ply", look, c, 1, pool)), {"field of view"}));
  EXPECT_EQ(folder.entries(), 0u);
}

}  // namespace
}  // namespace evpose::sim
