// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/fusion/window.h"

#include <ceres/ceres.h>
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <random>

#include "evpose/fusion/graph.h"
#include "evpose/fusion/particle_filter.h"

namespace evpose {
namespace {

const Eigen::Vector3d kGravity(0, 0, -9.81);

Eigen::Vector3d draw(std::mt19937& random, double sigma) {
  std::normal_distribution<double> normal(0, sigma);
  return {normal(random), normal(random), normal(random)};
}

ImuSample reading(TimeNs t) {
  const double s = to_seconds(t);
  return {t,
          {0.6 * std::sin(5 * s), 0.4 * std::cos(3 * s), 0.8},
          {1.5 * std::sin(4 * s), 1.2, 9.81 + std::cos(6 * s)}};
}

FusionState some_state() {
  FusionState s;
  s.nav.T_map_body = {so3::exp({0.3, -0.2, 1.1}), {1, 2, 3}};
  s.nav.velocity = {0.5, -1, 0.2};
  Vector15d sigma;
  sigma << 2e-3, 2e-3, 2e-3, 2e-3, 2e-3, 2e-3, 0.05, 0.05, 0.05, 0.02, 0.02, 0.02, 0.1, 0.1, 0.1;
  s.covariance.diagonal() = sigma.cwiseAbs2();
  return s;
}

PoseInformation measurement_of(const Vector6d& offset, double position_sigma, double rotation_sigma) {
  PoseInformation m;
  Vector6d information;
  information << Eigen::Vector3d::Constant(1 / (position_sigma * position_sigma)),
      Eigen::Vector3d::Constant(1 / (rotation_sigma * rotation_sigma));
  m.information = information.asDiagonal();
  m.information(0, 4) = m.information(4, 0) = 0.3 * std::sqrt(information(0) * information(4));
  m.vector = m.information * offset;
  return m;
}

/// A short flight with noisy poses: the true states, the motion between them, and what was measured where.
struct Problem {
  std::vector<FusionState> truth;
  std::vector<Preintegration> motion;
  std::vector<PoseInformation> measurements;
  std::vector<Pose> measured_at;
};

Problem make_problem(int states, unsigned seed) {
  std::mt19937 random(seed);
  Problem p;
  p.truth.push_back(some_state());
  p.truth[0].gyro_bias = {0.01, -0.02, 0.015};
  p.truth[0].accel_bias = {0.05, 0.03, -0.08};
  for (int i = 0; i < states; ++i) {
    Preintegration sum({0, 0, 0}, {0, 0, 0});
    for (int k = 0; k < 5; ++k)
      sum.add(reading((5 * i + k) * 4 * kNsPerMs), reading((5 * i + k + 1) * 4 * kNsPerMs), ImuNoise{});
    FusionState next = sum.predict(p.truth.back(), kGravity);
    next.t = (i + 1) * 20 * kNsPerMs;
    p.truth.push_back(next);
    p.motion.push_back(sum);
    Vector6d off, noise;
    off << draw(random, 5e-3), draw(random, 5e-3);
    noise << draw(random, 1e-3), draw(random, 5e-4);
    p.measured_at.push_back(next.nav.T_map_body.plus(off));
    p.measurements.push_back(
        measurement_of(next.nav.T_map_body.plus(noise).minus(p.measured_at.back()), 1e-3, 5e-4));
  }
  return p;
}

// --- the reference twin: the same factors, derivatives by differences, Ceres's minimiser ---

using Parameters = Eigen::Map<const Vector15d>;

Matrix15d root_information(const Matrix15d& covariance) {
  const Matrix15d information = covariance.ldlt().solve(Matrix15d::Identity());
  return Matrix15d(information.llt().matrixU());
}

FusionState moved(FusionState s, const double* d) {
  s.add(Parameters(d));
  return s;
}

struct MotionCost {
  const Preintegration& motion;
  FusionState start, end;
  Matrix15d root;
  bool operator()(const double* i, const double* j, double* r) const {
    Eigen::Map<Vector15d> out(r);
    out = root * motion.residual(moved(start, i), moved(end, j), kGravity).value;
    return true;
  }
};

struct MotionPriorCost {
  const MotionPrior& prior;
  FusionState start, end;
  MotionPrior::Matrix9d root;
  bool operator()(const double* i, const double* j, double* r) const {
    Eigen::Map<MotionPrior::Vector9d> out(r);
    out = root * prior.residual(moved(start, i), moved(end, j)).value;
    return true;
  }
};

struct PoseCost {
  FusionState state;
  PoseInformation measurement;
  Pose at;
  bool operator()(const double* i, double* r) const {
    const Vector6d z = measurement.information.ldlt().solve(measurement.vector);
    const Matrix6d U = measurement.information.llt().matrixU();
    Eigen::Map<Vector6d> out(r);
    out = U * (moved(state, i).nav.T_map_body.minus(at) - z);
    return true;
  }
};

struct PriorCost {
  FusionState state, at;
  Matrix15d root;
  bool operator()(const double* i, double* r) const {
    Eigen::Map<Vector15d> out(r);
    out = root * moved(state, i).minus(at);
    return true;
  }
};

TEST(Window, MeetsTheCeresReferenceWithPriorImuAndMeasurements) {
  const Problem p = make_problem(8, 4);
  FusionState first = some_state();
  first.angular_rate = {0.3, 0.5, 0.7};
  // As strong as the IMU, so that neither hides the other.
  const MotionPrior prior(3e-3, 0.05);
  std::vector<FusionState> initial{first};
  Window window(kGravity, prior);
  window.start(first);
  for (std::size_t i = 0; i < p.motion.size(); ++i) {
    FusionState next = p.motion[i].predict(initial.back(), kGravity);
    next.t = p.truth[i + 1].t;
    initial.push_back(next);
    window.add(p.motion[i], next, p.measurements[i], p.measured_at[i]);
  }
  ASSERT_TRUE(window.optimise(8));

  std::vector<Vector15d> d(initial.size(), Vector15d::Zero());
  ceres::Problem problem;
  problem.AddResidualBlock(new ceres::NumericDiffCostFunction<PriorCost, ceres::CENTRAL, 15, 15>(
                               new PriorCost{first, first, root_information(first.covariance)}),
                           nullptr, d[0].data());
  for (std::size_t i = 0; i < p.motion.size(); ++i) {
    problem.AddResidualBlock(
        new ceres::NumericDiffCostFunction<MotionCost, ceres::CENTRAL, 15, 15, 15>(new MotionCost{
            p.motion[i], initial[i], initial[i + 1], root_information(p.motion[i].covariance())}),
        nullptr, d[i].data(), d[i + 1].data());
    const MotionPrior::Matrix9d information = prior.covariance(0.02).inverse();
    problem.AddResidualBlock(
        new ceres::NumericDiffCostFunction<MotionPriorCost, ceres::CENTRAL, 9, 15, 15>(new MotionPriorCost{
            prior, initial[i], initial[i + 1], MotionPrior::Matrix9d(information.llt().matrixU())}),
        nullptr, d[i].data(), d[i + 1].data());
    problem.AddResidualBlock(new ceres::NumericDiffCostFunction<PoseCost, ceres::CENTRAL, 6, 15>(
                                 new PoseCost{initial[i + 1], p.measurements[i], p.measured_at[i]}),
                             nullptr, d[i + 1].data());
  }
  ceres::Solver::Options options;
  options.max_num_iterations = 100;
  options.function_tolerance = 1e-16;
  options.gradient_tolerance = 1e-16;
  options.parameter_tolerance = 1e-14;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  for (std::size_t i = 0; i < initial.size(); ++i) {
    const Vector15d difference = window.state(i).minus(moved(initial[i], d[i].data()));
    EXPECT_LT(difference.head<3>().norm(), 2e-6) << i;
    EXPECT_LT(difference.segment<3>(3).norm(), 2e-6) << i;
    EXPECT_LT(difference.segment<3>(6).norm(), 2e-5) << i;
    EXPECT_LT(difference.tail<6>().norm(), 2e-4) << i;
  }
  // The optimum is not where it began.
  EXPECT_GT(window.newest().minus(initial.back()).head<3>().norm(), 1e-4);
}

/// Without rotation the problem is linear: gyroscope zero, poses that tell positions only.
struct LinearFlight {
  explicit LinearFlight(unsigned seed) : random(seed) {}
  Preintegration motion() {
    Preintegration sum({0, 0, 0}, {0, 0, 0});
    ImuNoise noise;
    noise.gyro_density = noise.gyro_walk = 1e-12;
    sum.add({0, {0, 0, 0}, {0, 0, 9.81}}, {5 * kNsPerMs, {0, 0, 0}, {0, 0, 9.81}}, noise);
    return sum;
  }
  PoseInformation measurement() {
    PoseInformation m;
    m.information.topLeftCorner<3, 3>() = 1e6 * Eigen::Matrix3d::Identity();
    m.vector.head<3>() = m.information.topLeftCorner<3, 3>() * draw(random, 1e-3);
    return m;
  }
  static FusionState first() {
    FusionState s;
    Vector15d sigma;
    sigma << 1e-2, 1e-2, 1e-2, 1e-9, 1e-9, 1e-9, 0.1, 0.1, 0.1, 1e-9, 1e-9, 1e-9, 0.1, 0.1, 0.1;
    s.covariance.diagonal() = sigma.cwiseAbs2();
    return s;
  }
  std::mt19937 random;
};

TEST(Window, MarginalisingEqualsTheBatchOnALinearProblem) {
  LinearFlight flight(9);
  Window batch(kGravity), sliding(kGravity);
  batch.start(LinearFlight::first());
  sliding.start(LinearFlight::first());
  for (int k = 1; k <= 60; ++k) {
    const Preintegration motion = flight.motion();
    const PoseInformation m = flight.measurement();
    for (Window* w : {&batch, &sliding}) {
      FusionState next = motion.predict(w->newest(), kGravity);
      next.t = k * 5 * kNsPerMs;
      w->add(motion, next, m, Pose{});
    }
    if (k % 4 == 0) {
      ASSERT_TRUE(sliding.optimise(1));
      sliding.forget_before((k - 6) * 5 * kNsPerMs);
    }
  }
  ASSERT_TRUE(batch.optimise(3));
  ASSERT_TRUE(sliding.optimise(1));
  EXPECT_EQ(batch.size(), 61U);
  EXPECT_LT(sliding.size(), 12U);
  const Vector15d difference = sliding.newest().minus(batch.newest());
  const Matrix15d P = batch.newest().covariance;
  EXPECT_LT(difference.cwiseAbs().cwiseQuotient(P.diagonal().cwiseSqrt()).maxCoeff(), 1e-5);
  for (int i : {0, 1, 2, 6, 7, 8, 12, 13, 14})
    EXPECT_NEAR(sliding.newest().covariance(i, i) / P(i, i), 1, 1e-5) << i;
}

TEST(Window, OnALinearProblemInterTsFusionIsTheBatchsNewestState) {
  LinearFlight flight(11);
  const MotionPrior prior(5e-3, 1e-6);
  Window batch(kGravity, prior), incremental(kGravity, prior);
  batch.start(LinearFlight::first());
  incremental.start(LinearFlight::first());
  for (int k = 1; k <= 40; ++k) {
    const Preintegration motion = flight.motion();
    const PoseInformation m = flight.measurement();
    for (Window* w : {&batch, &incremental}) {
      FusionState next = motion.predict(w->newest(), kGravity);
      next.t = k * 5 * kNsPerMs;
      w->add(motion, next, m, Pose{});
    }
    ASSERT_TRUE(incremental.fuse_newest());
  }
  ASSERT_TRUE(batch.optimise(3));
  const Matrix15d P = batch.newest().covariance;
  const Vector15d difference = incremental.newest().minus(batch.newest());
  EXPECT_LT(difference.cwiseAbs().cwiseQuotient(P.diagonal().cwiseSqrt()).maxCoeff(), 1e-4);
  for (int i : {0, 1, 2, 6, 7, 8, 12, 13, 14})
    EXPECT_NEAR(incremental.newest().covariance(i, i) / P(i, i), 1, 1e-4) << i;
}

TEST(Window, OnALinearProblemTheNewestStateIsTheKalmanFilters) {
  // Joint optimisation changes the past, but of the newest state it can say no more than the filter.
  LinearFlight flight(10);
  Window window(kGravity);
  window.start(LinearFlight::first());
  std::vector<Preintegration> motions;
  std::vector<PoseInformation> measurements;
  for (int k = 1; k <= 20; ++k) {
    motions.push_back(flight.motion());
    measurements.push_back(flight.measurement());
    FusionState next = motions.back().predict(window.newest(), kGravity);
    next.t = k * 5 * kNsPerMs;
    window.add(motions.back(), next, measurements.back(), Pose{});
  }
  ASSERT_TRUE(window.optimise(3));

  // The textbook recursion of (p, v, b_a) along one axis.
  const double dt = 5e-3;
  const ImuNoise noise;
  Eigen::Matrix3d F, Q = Eigen::Matrix3d::Zero();
  F << 1, dt, -0.5 * dt * dt, 0, 1, -dt, 0, 0, 1;
  const double qa = noise.accel_density * noise.accel_density;
  Q << qa * dt * dt * dt / 3, 0.5 * qa * dt * dt, 0, 0.5 * qa * dt * dt, qa * dt, 0, 0, 0,
      noise.accel_walk * noise.accel_walk * dt;
  Eigen::Matrix3d P = Eigen::Vector3d(1e-4, 1e-2, 1e-2).asDiagonal();
  Eigen::Vector3d x = Eigen::Vector3d::Zero();
  for (const PoseInformation& m : measurements) {
    x = F * x;
    P = F * P * F.transpose() + Q;
    const Eigen::Vector3d K = P.col(0) / (P(0, 0) + 1e-6);
    x += K * (m.vector(0) * 1e-6 - x(0));
    P -= (K * P.row(0)).eval();
  }
  EXPECT_NEAR(window.newest().nav.T_map_body.p.x(), x(0), 1e-4 * std::sqrt(P(0, 0)));
  EXPECT_NEAR(window.newest().nav.velocity.x(), x(1), 1e-4 * std::sqrt(P(1, 1)));
  EXPECT_NEAR(window.newest().accel_bias.x(), x(2), 1e-4 * std::sqrt(P(2, 2)));
  EXPECT_NEAR(window.newest().covariance(0, 0) / P(0, 0), 1, 1e-4);
}

// --- the back ends as a whole, on one noisy flight ---

struct Flown {
  double position_mm = 0, bias = 0, nees6 = 0;
  FusionState end;
};

Flown fly(BackEndKind kind, MotionModel model, unsigned seed) {
  FusionConfig config;
  config.kind = kind;
  config.imu_noise_scale = 1;
  config.imu_scale_sigma = 0;
  const ImuNoise noise;
  const auto back_end = make_back_end(model, config, noise, Pose{});
  std::mt19937 random(seed);
  FusionState truth;
  truth.nav.T_map_body = {so3::exp({0.1, -0.2, 0.8}), {1, 2, 1}};
  truth.nav.velocity = {0.4, 0.2, 0};
  truth.gyro_bias = draw(random, 0.01);
  truth.accel_bias = draw(random, 0.05);
  NavState guess = truth.nav;
  Vector6d off;
  off << draw(random, config.start_position_sigma_m), draw(random, config.start_rotation_sigma_rad);
  guess.T_map_body = guess.T_map_body.plus(off);
  back_end->start(0, guess, {0, 0, 0});
  Flown out;
  const TimeNs dt = 2 * kNsPerMs;
  ImuSample before = reading(0);
  int updates = 0;
  for (int k = 1; k <= 500; ++k) {
    const ImuSample after = reading(k * dt);
    truth.nav = strapdown(truth.nav, before, after, {0, 0, 0}, {0, 0, 0}, kGravity);
    if (model == MotionModel::imu) {
      const double rate = std::sqrt(1 / to_seconds(dt));
      const Eigen::Vector3d ng = truth.gyro_bias + draw(random, noise.gyro_density * rate),
                            na = truth.accel_bias + draw(random, noise.accel_density * rate);
      ImuSample a = before, b = after;
      for (ImuSample* s : {&a, &b}) s->gyro += ng, s->accel += na;
      back_end->predict(a, b, ImuTrust::good);
    } else {
      back_end->predict(k * dt);
    }
    before = after;
    if (k % 2 != 0) continue;
    Vector6d scatter;
    scatter << draw(random, 3e-3), draw(random, 1e-3);
    PoseInformation m;
    Vector6d information;
    information << 1 / 9e-6, 1 / 9e-6, 1 / 9e-6, 1e6, 1e6, 1e6;
    m.information = information.asDiagonal();
    m.vector = m.information * truth.nav.T_map_body.plus(scatter).minus(back_end->state().nav.T_map_body);
    back_end->update(m);
    if (k <= 250) continue;
    const Vector6d e = back_end->state().nav.T_map_body.minus(truth.nav.T_map_body);
    out.position_mm += 1e3 * e.head<3>().norm();
    out.nees6 += e.dot(back_end->state().pose_covariance().ldlt().solve(e)) / 6;
    ++updates;
  }
  out.position_mm /= updates;
  out.nees6 /= updates;
  out.bias = (back_end->state().gyro_bias - truth.gyro_bias).norm();
  out.end = back_end->state();
  return out;
}

TEST(BackEnds, AllAreAccurateAndKnowHowGoodTheyAre) {
  for (const BackEndKind kind : {BackEndKind::ekf, BackEndKind::graph, BackEndKind::particle}) {
    double position_mm = 0, nees6 = 0, bias = 0;
    const int runs = kind == BackEndKind::particle ? 6 : 12;
    for (int run = 0; run < runs; ++run) {
      const Flown f = fly(kind, MotionModel::imu, 100 + run);
      position_mm += f.position_mm / runs;
      nees6 += f.nees6 / runs;
      bias += f.bias / runs;
    }
    EXPECT_LT(position_mm, kind == BackEndKind::particle ? 1.6 : 1.3) << static_cast<int>(kind);
    EXPECT_LT(bias, 4e-3) << static_cast<int>(kind);
    EXPECT_NEAR(nees6, 1, 0.45) << static_cast<int>(kind);
  }
}

TEST(BackEnds, GraphAndFilterAgreeFarInsideTheirUncertainty) {
  const Flown a = fly(BackEndKind::ekf, MotionModel::imu, 7),
              b = fly(BackEndKind::graph, MotionModel::imu, 7);
  const Vector15d difference = a.end.minus(b.end);
  EXPECT_LT(difference.cwiseAbs().cwiseQuotient(a.end.covariance.diagonal().cwiseSqrt()).maxCoeff(), 0.1);
  EXPECT_GT(difference.norm(), 0);  // they are not the same computation
}

TEST(BackEnds, ConstantVelocityWorksInAll) {
  for (const BackEndKind kind : {BackEndKind::ekf, BackEndKind::graph, BackEndKind::particle})
    EXPECT_LT(fly(kind, MotionModel::constant_velocity, 3).position_mm, 4) << static_cast<int>(kind);
}

TEST(BackEnds, AreTheSameInEveryRun) {
  for (const BackEndKind kind : {BackEndKind::ekf, BackEndKind::graph, BackEndKind::particle}) {
    const Flown a = fly(kind, MotionModel::imu, 5), b = fly(kind, MotionModel::imu, 5);
    EXPECT_EQ(a.end.covariance, b.end.covariance);
    EXPECT_EQ(a.end.nav.T_map_body.p, b.end.nav.T_map_body.p);
  }
}

TEST(BackEnds, FurtherStatesAreTheFiltersAlone) {
  for (const BackEndKind kind : {BackEndKind::graph, BackEndKind::particle}) {
    FusionConfig config;
    config.kind = kind;
    EXPECT_EQ(resolved(config, true)->segment_offsets, SegmentOffsetUse::off);
    config.calibration.rotation = true;
    ASSERT_FALSE(resolved(config, true).ok());
    EXPECT_NE(resolved(config, true).error().line().find("fusion.calibration"), std::string::npos);
    config.calibration.rotation = false;
    config.segment_offsets = SegmentOffsetUse::on;
    ASSERT_FALSE(resolved(config, true).ok());
    EXPECT_NE(resolved(config, true).error().line().find("fusion.segment_offsets"), std::string::npos);
  }
}

}  // namespace
}  // namespace evpose
