// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/flight/trajectory.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "evpose/core/config.h"
#include "evpose/io/files/test_files.h"
#include "evpose/io/motion/trajectory_tum.h"
#include "evpose/sim/world/random.h"

namespace evpose::sim {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
using Kind = TrajectoryKind;

TrajectoryConfig config_of(Kind kind) {
  TrajectoryConfig c;
  c.kind = kind;
  if (kind == Kind::landing) c.centre_x_m = c.centre_y_m = 0, c.centre_z_m = 0.3;
  if (kind == Kind::traverse) {
    c.centre_x_m = 50, c.centre_y_m = 0, c.centre_z_m = 4.75;
    c.size_forward_m = 90, c.size_left_m = 3, c.size_up_m = 6.5;
  }
  return c;
}

Trajectory make(const TrajectoryConfig& c) {
  auto t = make_trajectory(c);
  EXPECT_TRUE(t.ok()) << error_line(t);
  return std::move(t).value();
}

const Kind kBuiltIn[] = {Kind::square_spiral, Kind::landing,   Kind::hover, Kind::aggressive,
                         Kind::slow,          Kind::lissajous, Kind::sweep, Kind::traverse};

Trajectory wild() {
  Random random(4);
  std::vector<Pose> control(60);
  for (Pose& pose : control) {
    const auto vector = [&](double a) {
      return Eigen::Vector3d(random.uniform(-a, a), random.uniform(-a, a), random.uniform(-a, a));
    };
    pose = {so3::exp(vector(0.8)), vector(0.5)};
  }
  Trajectory::Wave wave{7, {0.3, 1, 2}, {0.02, 0.01, 0.03}, {0.1, 0.2, 0.05}};
  return {PoseSpline(0.1, control), {wave, wave}, 5.9};
}

void expect_derivatives_equal_differences(const Trajectory& trajectory, double end_s) {
  const double h = 1e-5;
  for (double t = 2 * h; t < end_s; t += 0.0371) {
    const BodyMotion now = trajectory.at(t), before = trajectory.at(t - h), after = trajectory.at(t + h);
    const auto check = [&](const Eigen::Vector3d& difference, const Eigen::Vector3d& value,
                           const char* what) {
      EXPECT_LT((difference / (2 * h) - value).norm(), 1e-5 * (1 + value.norm())) << what << " at " << t;
    };
    check(after.T_map_body.p - before.T_map_body.p, now.velocity, "velocity");
    check(after.velocity - before.velocity, now.acceleration, "acceleration");
    check(so3::log(before.T_map_body.q.conjugate() * after.T_map_body.q), now.rate, "rate");
    check(after.rate - before.rate, now.angular_acceleration, "angular acceleration");
  }
}

TEST(Trajectory, DerivativesEqualDifferences) {
  expect_derivatives_equal_differences(wild(), 5.9);
  for (const Kind kind : kBuiltIn) expect_derivatives_equal_differences(make(config_of(kind)), 4);
}

TEST(Trajectory, AccelerationsAreContinuousAtKnots) {
  const Trajectory trajectory = wild();
  const double h = 1e-9;
  for (int k = -2; k < 63; ++k) {
    const BodyMotion before = trajectory.at(0.1 * k - h), after = trajectory.at(0.1 * k + h);
    // A jump would be of the size of the accelerations, some 10 to 100.
    EXPECT_LT((after.acceleration - before.acceleration).norm(), 1e-4) << k;
    EXPECT_LT((after.angular_acceleration - before.angular_acceleration).norm(), 1e-4) << k;
    EXPECT_LT(after.T_map_body.minus(before.T_map_body).norm(), 1e-6) << k;
  }
}

TEST(Trajectory, SplineRestsBeyondItsEnds) {
  const PoseSpline spline(0.1, {{so3::exp({1, 0, 0}), {1, 2, 3}}, {so3::exp({0, 1, 0}), {2, 2, 2}}});
  for (const double t : {-0.5, -100.0, 0.6, 100.0}) {
    const BodyMotion m = spline.at(t);
    EXPECT_LT(m.T_map_body
                  .minus(t < 0 ? Pose{so3::exp({1, 0, 0}), {1, 2, 3}} : Pose{so3::exp({0, 1, 0}), {2, 2, 2}})
                  .norm(),
              1e-12);
    EXPECT_LT(m.velocity.norm() + m.rate.norm() + m.acceleration.norm() + m.angular_acceleration.norm(),
              1e-9);
  }
}

/// A recording that does not begin at rest begins in the middle of a flight.
TEST(Trajectory, BeginsInFlightAsItGoesOn) {
  for (const auto kind : {TrajectoryKind::aggressive, TrajectoryKind::square_spiral, TrajectoryKind::sweep,
                          TrajectoryKind::hover, TrajectoryKind::traverse}) {
    TrajectoryConfig c;
    c.kind = kind;
    c.vibration_mm = c.vibration_deg = 0;
    c.duration_s = 4;
    const auto trajectory = make_trajectory(c);
    ASSERT_TRUE(trajectory);
    const auto most_from = [&](double from_s, double to_s) {
      Eigen::Vector2d most = Eigen::Vector2d::Zero();
      for (double t = from_s; t < to_s; t += 1e-3) {
        const BodyMotion m = trajectory->at(t);
        most = most.cwiseMax(Eigen::Vector2d(m.acceleration.norm(), m.angular_acceleration.norm()));
      }
      return most;
    };
    const Eigen::Vector2d first = most_from(0, 0.05), later = most_from(0.05, 3.9);
    EXPECT_LE(first.x(), 1.5 * later.x() + 1e-9) << static_cast<int>(kind);
    EXPECT_LE(first.y(), 1.5 * later.y() + 1e-9) << static_cast<int>(kind);
  }
}

TEST(PoseSpline, FitGivesASplineBackFromItsPoses) {
  Random random(9);
  std::vector<Pose> control(40);
  Pose pose;
  for (Pose& c : control) {
    pose = pose.plus(0.1 * (Vector6d() << random.normal(), random.normal(), random.normal(), random.normal(),
                            random.normal(), random.normal())
                               .finished());
    c = pose;
  }
  const PoseSpline spline(0.1, control);
  std::vector<double> t_s;
  std::vector<Pose> poses;
  for (double t = 0; t < spline.duration_s(); t += 0.013) {
    t_s.push_back(t);
    poses.push_back(spline.at(t).T_map_body);
  }
  const PoseSpline again = PoseSpline::fit(t_s, poses, 0.1);
  for (double t = 0.2; t < 3.7; t += 0.0171)
    EXPECT_LT(again.at(t).T_map_body.minus(spline.at(t).T_map_body).norm(), 1e-5) << t;
}

struct Extremes {
  double speed = 0, rate = 0;
  Eigen::Vector3d low = Eigen::Vector3d::Constant(1e9), high = Eigen::Vector3d::Constant(-1e9);
};
Extremes extremes_of(const Trajectory& trajectory) {
  Extremes e;
  for (double t = 0; t <= trajectory.duration_s(); t += 0.005) {
    const BodyMotion m = trajectory.at(t);
    e.speed = std::max(e.speed, m.velocity.norm());
    e.rate = std::max(e.rate, m.rate.norm());
    e.low = e.low.cwiseMin(m.T_map_body.p);
    e.high = e.high.cwiseMax(m.T_map_body.p);
  }
  return e;
}

TEST(Trajectory, FastestMomentsAreThoseOfTheConfig) {
  for (const Kind kind : {Kind::square_spiral, Kind::aggressive, Kind::slow, Kind::lissajous, Kind::sweep})
    for (const double speed : {0.5, 3.0})
      for (const double rate : {5.0, 40.0}) {
        TrajectoryConfig c = config_of(kind);
        c.speed_m_s = speed;
        c.rate_deg_s = rate;
        for (c.seed = 1; c.seed <= 3; ++c.seed) {
          const Extremes e = extremes_of(make(c));
          EXPECT_LT(e.speed, 1.02 * speed) << static_cast<int>(kind);
          EXPECT_GT(e.speed, 0.95 * speed) << static_cast<int>(kind);
          EXPECT_LT(e.rate, 1.02 * rate * kDegree) << static_cast<int>(kind);
          EXPECT_GT(e.rate, 0.6 * rate * kDegree) << static_cast<int>(kind) << " " << speed << " " << rate;
        }
      }
}

TEST(Trajectory, OwnValuesOfTheKindsAreKeptAndTheVolumeToo) {
  const struct {
    Kind kind;
    double speed, rate_deg_s;
  } rows[] = {{Kind::square_spiral, 0.8, 18}, {Kind::landing, 2.5, 15},   {Kind::aggressive, 5, 120},
              {Kind::slow, 0.03, 2},          {Kind::lissajous, 1.5, 10}, {Kind::sweep, 1.5, 15},
              {Kind::traverse, 4, 15},        {Kind::hover, 0.25, 18}};  // hover: with its vibration
  for (const auto& row : rows) {
    TrajectoryConfig c = config_of(row.kind);
    const Extremes e = extremes_of(make(c));
    EXPECT_LT(e.speed, 1.03 * row.speed) << static_cast<int>(row.kind);
    EXPECT_GT(e.speed, 0.7 * row.speed) << static_cast<int>(row.kind);
    EXPECT_LT(e.rate, 1.02 * row.rate_deg_s * kDegree) << static_cast<int>(row.kind);
    EXPECT_GT(e.rate, 0.5 * row.rate_deg_s * kDegree) << static_cast<int>(row.kind);
    if (row.kind == Kind::landing) continue;
    const Eigen::Vector3d centre(c.centre_x_m, c.centre_y_m, c.centre_z_m);
    const Eigen::Vector3d half = 0.5 * Eigen::Vector3d(c.size_forward_m, c.size_left_m, c.size_up_m);
    const double margin = 0.01;
    EXPECT_GE((e.low - centre + half).minCoeff(), -margin) << static_cast<int>(row.kind);
    EXPECT_LE((e.high - centre - half).maxCoeff(), margin) << static_cast<int>(row.kind);
  }
}

TEST(Trajectory, LandingGoesFromItsStartToStandOverThePad) {
  TrajectoryConfig c = config_of(Kind::landing);
  c.start_forward_m = -1.5;
  c.start_left_m = 0.8;
  const Trajectory trajectory = make(c);
  EXPECT_LT((trajectory.at(0).T_map_body.p - Eigen::Vector3d(-1.5, 0.8, 6.3)).norm(), 0.3);
  EXPECT_GT(trajectory.duration_s(), 4);
  EXPECT_LT(trajectory.duration_s(), 10);
  const BodyMotion end = trajectory.at(trajectory.duration_s());
  EXPECT_LT((end.T_map_body.p - Eigen::Vector3d(0, 0, 0.55)).norm(), 1e-6);
  EXPECT_LT(end.velocity.norm() + end.rate.norm() + end.acceleration.norm(), 1e-6);
  EXPECT_LT(so3::log(end.T_map_body.q).norm(), 1e-6);  // level
  // Above the pad before it is low.
  for (double t = 0; t < trajectory.duration_s(); t += 0.01) {
    const Eigen::Vector3d p = trajectory.at(t).T_map_body.p;
    EXPECT_GT(p.z(), 0.5);
    EXPECT_TRUE(p.z() > 1.3 || p.head<2>().norm() < 0.35) << p.transpose();
  }
}

TEST(Trajectory, RestsAtTheStartAsLongAsTold) {
  for (const Kind kind : {Kind::square_spiral, Kind::traverse, Kind::lissajous}) {
    TrajectoryConfig c = config_of(kind);
    c.rest_s = 1.5;
    const Trajectory trajectory = make(c);
    for (double t = 0; t <= 1.5; t += 0.05) {
      const BodyMotion m = trajectory.at(t);
      EXPECT_LT(m.velocity.norm() + m.rate.norm(), 1e-9) << t;
    }
    EXPECT_GT(extremes_of(trajectory).speed, 0.5);
  }
}

TEST(Trajectory, SeedsDifferAndTheSameSeedDoesNot) {
  TrajectoryConfig c = config_of(Kind::square_spiral);
  const Pose one = make(c).at(2.5).T_map_body, same = make(c).at(2.5).T_map_body;
  c.seed = 2;
  const Pose other = make(c).at(2.5).T_map_body;
  EXPECT_EQ(one.p, same.p);
  EXPECT_EQ(one.q.coeffs(), same.q.coeffs());
  EXPECT_GT((one.p - other.p).norm(), 0.01);
}

// Noise-free IMU at 1 kHz, integrated by the classical Runge-Kutta method over pairs of its intervals: the
// mid-point rule is too coarse for the fast ones.
TEST(Trajectory, IntegratedRatesAndForcesReturnToTheTrajectoryAfterTenSeconds) {
  for (const Kind kind : kBuiltIn) {
    TrajectoryConfig c = config_of(kind);
    c.duration_s = 10;
    const Trajectory trajectory = make(c);
    const auto rate = [&](int i) { return trajectory.at(1e-3 * i).rate; };
    const auto force = [&](int i) -> Eigen::Vector3d {
      const BodyMotion m = trajectory.at(1e-3 * i);
      return m.T_map_body.q.conjugate() * (m.acceleration - gravity_map());
    };
    struct State {
      Eigen::Vector4d q;
      Eigen::Vector3d v, p;
    };
    const auto slope = [](const State& s, const Eigen::Vector3d& w, const Eigen::Vector3d& f) -> State {
      const Eigen::Quaterniond q(s.q);
      const Eigen::Quaterniond dq = q * Eigen::Quaterniond(0, 0.5 * w.x(), 0.5 * w.y(), 0.5 * w.z());
      return {dq.coeffs(), q.normalized() * f + gravity_map(), s.v};
    };
    const auto add = [](const State& s, double h, const State& d) -> State {
      return {s.q + h * d.q, s.v + h * d.v, s.p + h * d.p};
    };
    const BodyMotion start = trajectory.at(0);
    State s{start.T_map_body.q.coeffs(), start.velocity, start.T_map_body.p};
    const double h = 2e-3;
    for (int i = 0; i < 10000; i += 2) {
      const State k1 = slope(s, rate(i), force(i));
      const State k2 = slope(add(s, h / 2, k1), rate(i + 1), force(i + 1));
      const State k3 = slope(add(s, h / 2, k2), rate(i + 1), force(i + 1));
      const State k4 = slope(add(s, h, k3), rate(i + 2), force(i + 2));
      s = add(add(add(add(s, h / 6, k1), h / 3, k2), h / 3, k3), h / 6, k4);
      s.q.normalize();
    }
    const BodyMotion end = trajectory.at(10);
    EXPECT_LT((s.p - end.T_map_body.p).norm(), 1e-4) << static_cast<int>(kind);
    EXPECT_LT((s.v - end.velocity).norm(), 1e-4) << static_cast<int>(kind);
    EXPECT_LT(so3::log(Eigen::Quaterniond(s.q).conjugate() * end.T_map_body.q).norm(), 1e-5);
  }
}

TEST(Trajectory, FileIsFlownAsWritten) {
  const TemporaryFolder folder;
  const Trajectory original = make(config_of(Kind::square_spiral));
  std::vector<TimedPose> rows;
  const TimeNs start = 1'700'000'000'123'456'789;
  for (int i = 0; i <= 1000; ++i)
    rows.push_back({start + i * 10 * kNsPerMs, original.at(0.01 * i).T_map_body});
  ASSERT_TRUE(write_tum(folder / "a.tum", rows).ok());
  TrajectoryConfig c;
  c.kind = Kind::file;
  c.file = folder / "a.tum";
  const Trajectory again = make(c);
  EXPECT_NEAR(again.duration_s(), 10, 1e-9);
  for (double t = 0.3; t < 9.7; t += 0.037) {
    const BodyMotion a = original.at(t), b = again.at(t);
    EXPECT_LT(b.T_map_body.minus(a.T_map_body).norm(), 5e-4) << t;
    EXPECT_LT((a.velocity - b.velocity).norm(), 0.02) << t;
    EXPECT_LT((a.rate - b.rate).norm(), 0.02) << t;
  }
  expect_derivatives_equal_differences(again, 5);
  c.rest_s = 1;
  const Trajectory later = make(c);
  EXPECT_LT(later.at(0.5).velocity.norm(), 1e-9);
  EXPECT_LT(later.at(6.78).T_map_body.minus(original.at(5).T_map_body).norm(), 2e-3);
}

TEST(Trajectory, FileWithAGapIsBridged) {
  const TemporaryFolder folder;
  const Trajectory original = make(config_of(Kind::lissajous));
  std::vector<TimedPose> rows;
  for (int i = 0; i <= 500; ++i)
    if (i < 200 || i > 230) rows.push_back({i * 10 * kNsPerMs, original.at(0.01 * i).T_map_body});
  ASSERT_TRUE(write_tum(folder / "a.tum", rows).ok());
  TrajectoryConfig c;
  c.kind = Kind::file;
  c.file = folder / "a.tum";
  const Trajectory again = make(c);
  for (double t = 2; t < 2.3; t += 0.01)
    EXPECT_LT(again.at(t).T_map_body.minus(original.at(t).T_map_body).norm(), 0.02) << t;
}

TEST(Trajectory, WaypointsArePassedAndPausedAt) {
  const TemporaryFolder folder;
  TrajectoryConfig c;
  c.kind = Kind::waypoints;
  c.file = folder.file("a.txt", "0 0 1 0\n4 0 1 90 3\n4 3 2 170\n4 3 2 -170\n");
  const Trajectory trajectory = make(c);
  double nearest = 1e9, still_s = 0;
  for (double t = 0; t <= trajectory.duration_s(); t += 0.01) {
    const BodyMotion m = trajectory.at(t);
    nearest = std::min(nearest, (m.T_map_body.p - Eigen::Vector3d(4, 0, 1)).norm());
    still_s += m.velocity.norm() < 1e-3 && t > 2 && t < 9 ? 0.01 : 0;
    EXPECT_LT(m.velocity.norm(), 1.01);
  }
  EXPECT_LT(nearest, 1e-6);
  EXPECT_NEAR(still_s, 3 - 1.6, 0.3);  // rounding takes 0.8 s of each end
  EXPECT_LT((trajectory.at(trajectory.duration_s()).T_map_body.p - Eigen::Vector3d(4, 3, 2)).norm(), 1e-3);
}

TEST(Trajectory, BadFilesAndConfigsAreRefusedInOneLine) {
  const TemporaryFolder folder;
  const auto line = [](const TrajectoryConfig& c) { return error_line(make_trajectory(c)); };
  TrajectoryConfig c;
  c.kind = Kind::file;
  EXPECT_TRUE(says(line(c), {"no file named"}));
  c.file = folder / "none.tum";
  EXPECT_TRUE(says(line(c), {"none.tum"}));
  c.file = folder.file("a.tum", "2 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n");
  EXPECT_TRUE(says(line(c), {"a.tum:2", "does not come after"}));
  std::string hours;
  for (int i = 0; i <= 260; ++i) hours += text(56.0 * i, " 0 0 0 0 0 0 1\n");
  c.file = folder.file("b.tum", hours);
  EXPECT_TRUE(says(line(c), {"b.tum", "covers"}));
  c.file = folder.file("c.tum", "0 0 0 0 0 0 0 1\n1 1e200 0 0 0 0 0 1\n");
  EXPECT_TRUE(says(line(c), {"c.tum", "position"}));
  c = config_of(Kind::landing);
  c.speed_m_s = 0;
  EXPECT_TRUE(says(line(c), {"speed_m_s", "never"}));
  c = config_of(Kind::traverse);
  c.speed_m_s = 1e-3;
  EXPECT_TRUE(says(line(c), {"speed_m_s", "takes"}));
  ConfigTable table;
  table.group("trajectory", c);
  EXPECT_FALSE(table.set("trajectory.speed", "1", "test"));
  EXPECT_TRUE(table.set("trajectory.kind", "hover", "test"));
}

}  // namespace
}  // namespace evpose::sim
