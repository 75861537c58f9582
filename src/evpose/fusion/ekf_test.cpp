// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/fusion/ekf.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <random>

namespace evpose {
namespace {

const Eigen::Vector3d kGravity(0, 0, -9.81);

NavState some_state() {
  NavState s;
  s.T_map_body = {so3::exp({0.3, -0.2, 1.1}), {1, 2, 3}};
  s.velocity = {0.5, -1, 0.2};
  return s;
}

ImuSample sample(TimeNs t) { return {t, {0.4, -0.7, 1.3}, {1.5, -0.8, 9.2}}; }

/// The error (p, phi, v) of b against a.
Eigen::Matrix<double, 9, 1> error(const NavState& b, const NavState& a) {
  Eigen::Matrix<double, 9, 1> e;
  e << b.T_map_body.minus(a.T_map_body), b.velocity - a.velocity;
  return e;
}

TEST(Ekf, CovarianceGrowsAsDifferencesOfTheStrapdownSay) {
  // With all noise off, P after one long step is F P F^T: check F column by column against perturbed runs.
  FusionConfig config;
  config.imu_noise_scale = 1e-2;
  config.imu_scale_sigma = 0;
  const ImuNoise silent{0, 0, 0, 0, 1000, {}};
  const ImuSample a = sample(0), b = sample(5 * kNsPerMs);
  const auto perturbed_run = [&](int i, double h) {
    Vector15d d = Vector15d::Zero();
    d(i) = h;
    NavState s = some_state();
    s.T_map_body = s.T_map_body.plus(d.head<6>());
    s.velocity += d.segment<3>(6);
    return strapdown(s, a, b, d.segment<3>(9), d.segment<3>(12), kGravity);
  };
  Matrix15d F = Matrix15d::Identity();
  const NavState plain = perturbed_run(0, 0);
  for (int i = 0; i < 15; ++i) {
    const double h = 1e-5;
    F.block<9, 1>(0, i) = (error(perturbed_run(i, h), plain) - error(perturbed_run(i, -h), plain)) / (2 * h);
  }
  Ekf ekf(StatePropagator(MotionModel::imu, config, silent));
  ekf.start(0, some_state(), {0, 0, 0});
  const Matrix15d P = ekf.state().covariance;
  ekf.predict(a, b, ImuTrust::good);
  const Matrix15d expected = F * P * F.transpose();
  const Matrix15d got = ekf.state().covariance;
  const Vector15d sigma = expected.diagonal().cwiseSqrt();
  const Matrix15d relative = (got - expected).cwiseQuotient(sigma * sigma.transpose());
  EXPECT_LT(relative.cwiseAbs().maxCoeff(), 1e-4);
}

TEST(Ekf, PredictedCovarianceIsThatOfManyNoisyRuns) {
  ImuNoise noise;
  noise.accel_density = 0.02;
  noise.gyro_density = 0.004;
  noise.accel_walk = noise.gyro_walk = 0;
  FusionConfig config;
  config.imu_noise_scale = 1;
  config.imu_scale_sigma = 0;
  Ekf ekf(StatePropagator(MotionModel::imu, config, noise));
  ekf.start(0, some_state(), {0, 0, 0});
  const int steps = 200, runs = 1500;
  const TimeNs dt = kNsPerMs;
  NavState truth = some_state();
  for (int k = 0; k < steps; ++k) {
    ekf.predict(sample(k * dt), sample((k + 1) * dt), ImuTrust::good);
    truth = strapdown(truth, sample(k * dt), sample((k + 1) * dt), {0, 0, 0}, {0, 0, 0}, kGravity);
  }
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  const auto draw = [&](double s) {
    return Eigen::Vector3d(s * normal(random), s * normal(random), s * normal(random));
  };
  double nees = 0;
  const Matrix15d P = ekf.state().covariance;
  const Eigen::LDLT<Eigen::Matrix<double, 9, 9>> solver(P.topLeftCorner<9, 9>());
  for (int run = 0; run < runs; ++run) {
    NavState s = some_state();
    Vector6d d;
    d << draw(config.start_position_sigma_m), draw(config.start_rotation_sigma_rad);
    s.T_map_body = s.T_map_body.plus(d);
    s.velocity += draw(config.start_velocity_sigma_m_s);
    const Eigen::Vector3d bg = draw(config.start_gyro_bias_sigma_rad_s),
                          ba = draw(config.start_accel_bias_sigma_m_s2);
    const double rate = std::sqrt(1.0 / to_seconds(dt));
    for (int k = 0; k < steps; ++k) {
      ImuSample a = sample(k * dt), b = sample((k + 1) * dt);
      const Eigen::Vector3d ng = draw(noise.gyro_density * rate), na = draw(noise.accel_density * rate);
      for (ImuSample* x : {&a, &b}) x->gyro += ng, x->accel += na;
      s = strapdown(s, a, b, bg, ba, kGravity);
    }
    const Eigen::Matrix<double, 9, 1> e = error(s, truth);
    nees += e.dot(solver.solve(e));
  }
  EXPECT_NEAR(nees / runs / 9, 1.0, 0.06);
}

PoseInformation full_measurement(const Vector6d& offset) {
  PoseInformation m;
  Matrix6d A = Matrix6d::Identity();
  A(0, 4) = 0.3;
  A(2, 3) = -0.7;
  m.information = A.transpose() * 1e5 * A;
  m.vector = m.information * offset;
  return m;
}

TEST(Ekf, UpdateIsTheTextbookKalmanUpdate) {
  Ekf ekf(StatePropagator(MotionModel::imu, FusionConfig{}, ImuNoise{}));
  ekf.start(0, some_state(), {0, 0, 0});
  for (int k = 0; k < 20; ++k) ekf.predict(sample(k * kNsPerMs), sample((k + 1) * kNsPerMs), ImuTrust::good);
  const FusionState before = ekf.state();
  Vector6d z;
  z << 1e-3, -2e-3, 5e-4, 1e-5, 2e-5, -1e-5;
  const PoseInformation m = full_measurement(z);
  const Eigen::Matrix<double, 15, 6> P_x = before.covariance.leftCols<6>();
  const Matrix6d S = before.pose_covariance() + m.information.inverse();
  const Eigen::Matrix<double, 15, 6> K = P_x * S.inverse();
  const Vector15d dx = K * z;
  const Matrix15d P = before.covariance - K * P_x.transpose();
  EXPECT_NEAR(innovation(ekf.state().pose_covariance(), m), z.dot(S.inverse() * z) / 6, 1e-9);
  ekf.update(m);
  EXPECT_LT((ekf.state().nav.T_map_body.minus(before.nav.T_map_body) - dx.head<6>()).norm(), 1e-10);
  EXPECT_LT((ekf.state().nav.velocity - before.nav.velocity - dx.segment<3>(6)).norm(), 1e-12);
  EXPECT_LT((ekf.state().gyro_bias - dx.segment<3>(9)).norm(), 1e-12);
  // Up to the turn of the attitude error's axes, a part of |dphi| / 2.
  EXPECT_LT((ekf.state().covariance - P).cwiseAbs().maxCoeff(), 1e-4 * P.diagonal().maxCoeff());
}

TEST(Ekf, SingularMeasurementLeavesTheOtherDirectionsAlone) {
  Ekf ekf(StatePropagator(MotionModel::imu, FusionConfig{}, ImuNoise{}));
  ekf.start(0, some_state(), {0, 0, 0});
  PoseInformation m;
  m.information(0, 0) = 1e8;
  m.vector(0) = 1e8 * 1e-3;
  const Matrix15d before = ekf.state().covariance;
  ekf.update(m);
  EXPECT_LT(ekf.state().covariance(0, 0), 0.01 * before(0, 0));
  EXPECT_DOUBLE_EQ(ekf.state().covariance(1, 1), before(1, 1));
  EXPECT_DOUBLE_EQ(ekf.state().nav.T_map_body.p.y(), 2.0);
}

TEST(Ekf, EmptyMeasurementChangesNothing) {
  Ekf ekf(StatePropagator(MotionModel::imu, FusionConfig{}, ImuNoise{}));
  ekf.start(0, some_state(), {0, 0, 0});
  const Matrix15d before = ekf.state().covariance;
  EXPECT_EQ(innovation(ekf.state().pose_covariance(), {}), 0);
  ekf.update(PoseInformation{});
  EXPECT_EQ(ekf.state().covariance, before);
}

TEST(Ekf, TheVelocityThatIsMeasuredWithThePoseIsThatOfTheClosedForm) {
  FusionConfig config;
  config.calibration.on = false;
  Ekf ekf(StatePropagator(MotionModel::imu, config, ImuNoise{}));
  ekf.start(0, some_state(), {0, 0, 0});
  for (int k = 0; k < 20; ++k) ekf.predict(sample(k * kNsPerMs), sample((k + 1) * kNsPerMs), ImuTrust::good);
  const FusionState before = ekf.state();
  std::srand(3);
  const Eigen::Matrix<double, 9, 9> root = 30 * Eigen::Matrix<double, 9, 9>::Random();
  const SeenMeasurement seen{root * root.transpose(), 1e-2 * Eigen::VectorXd::Random(9)};
  Matrix15d information = before.covariance.inverse();
  information.topLeftCorner<9, 9>() += seen.information;
  const Matrix15d P = information.inverse();
  ekf.update(seen);
  const Vector15d moved = ekf.state().minus(before), expected = P.leftCols<9>() * seen.vector;
  EXPECT_LT((moved - expected).norm(), 1e-6 * expected.norm());
  EXPECT_LT((ekf.state().covariance - P).norm(), 1e-6 * P.norm());
  EXPECT_EQ(ekf.filter().block_states(), 0);
}

/// Both ways of telling the filter what contours say of a camera with other numbers than given.
/// As the joint Kalman update of state and kept pose says, from the filter's joint covariance before it.
TEST(Ekf, AKeptPoseAndThePoseAreMeasuredTogether) {
  Ekf ekf(StatePropagator(MotionModel::imu, {}, {}));
  ekf.start(0, some_state(), {0, 0, 0});
  for (int k = 0; k < 20; ++k) {
    if (k == 5) ekf.keep_pose();
    ekf.predict(sample(k * kNsPerMs), sample((k + 1) * kNsPerMs), ImuTrust::good);
  }
  const FusionState before = ekf.state();
  const Pose kept = *ekf.kept_pose();
  const Eigen::MatrixXd P = ekf.filter().joint_covariance();
  std::mt19937 random(8);
  std::normal_distribution<double> normal;
  RelativeInformation m;
  for (int i = 0; i < 9; ++i) {
    const RelativeInformation::Vector h = RelativeInformation::Vector::NullaryExpr(
        RelativeInformation::kNumbers, [&] { return normal(random); });
    m.information += 1e5 * h * h.transpose();
    m.vector += 10 * normal(random) * h;
  }
  ekf.update(m);
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(P.rows(), P.rows());
  // The camera is no state: what is told of it is left out.
  H.topLeftCorner<6, 6>() = m.information.topLeftCorner<6, 6>();
  H.topRightCorner<6, 6>() = m.information.block<6, 6>(0, 6);
  H.bottomLeftCorner<6, 6>() = m.information.block<6, 6>(6, 0);
  H.bottomRightCorner<6, 6>() = m.information.block<6, 6>(6, 6);
  Eigen::VectorXd b = Eigen::VectorXd::Zero(P.rows());
  b.head<6>() = m.vector.head<6>(), b.tail<6>() = m.vector.segment<6>(6);
  const Eigen::MatrixXd after =
      (Eigen::MatrixXd::Identity(P.rows(), P.rows()) + P * H).partialPivLu().solve(P);
  const Eigen::VectorXd dx = after * b;
  EXPECT_LT((ekf.state().minus(before) - dx.head<15>()).norm(), 1e-6 * dx.norm() + 1e-12);
  EXPECT_LT((ekf.kept_pose()->minus(kept) - dx.tail<6>()).norm(), 1e-6 * dx.norm() + 1e-12);
  EXPECT_LT((ekf.state().covariance - after.topLeftCorner<15, 15>()).norm(), 1e-2 * after.norm());
}

/// However well the motion since then is known, the pose is not known better than the kept one was.
TEST(Ekf, WhatIsMeasuredBesideAKeptPoseTellsNothingOfWhereItWas) {
  Ekf ekf(StatePropagator(MotionModel::imu, {}, {}));
  ekf.start(0, some_state(), {0, 0, 0});
  ekf.keep_pose();
  const Matrix6d kept = ekf.state().pose_covariance();
  for (int k = 0; k < 50; ++k) ekf.predict(sample(k * kNsPerMs), sample((k + 1) * kNsPerMs), ImuTrust::good);
  RelativeInformation m;  // of the two positions' difference alone
  constexpr double kStrong = 1e14;
  for (int i = 0; i < 3; ++i) {
    RelativeInformation::Vector h = RelativeInformation::Vector::Zero(RelativeInformation::kNumbers);
    h(i) = 1, h(6 + i) = -1;
    m.information += kStrong * h * h.transpose();
  }
  ekf.update(m);
  const Matrix6d now = ekf.state().pose_covariance();
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(now(i, i) / kept(i, i), 1, 1e-3) << i;
}

TEST(Ekf, PoseAndNumbersMeasuredTogetherAreTheirContours) {
  FusionConfig config;
  config.calibration.intrinsics = true;
  config.calibration.start_intrinsics_sigma = Eigen::VectorXd::LinSpaced(5, 0.01, 1);
  const StatePropagator propagator(MotionModel::imu, config, ImuNoise{});
  Ekf one_by_one(propagator, config), together(propagator, config);
  one_by_one.start(0, some_state(), {0, 0, 0});
  together.start(0, some_state(), {0, 0, 0});
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  PoseInformation pose;
  SeenMeasurement all{Eigen::MatrixXd::Zero(14, 14), Eigen::VectorXd::Zero(14)};
  std::vector<ContourOffset> contours;
  for (int i = 0; i < 40; ++i) {
    ContourOffset c;
    c.point_body = {normal(random), normal(random), 4};
    c.across_body = 300 * Eigen::Vector3d(normal(random), normal(random), 0).normalized();
    c.offset_px = 0.01 * normal(random);
    c.weight = 25;
    c.by_intrinsics = Eigen::RowVectorXd::NullaryExpr(5, [&] { return normal(random); });
    const Vector6d by_pose = c.by_pose(some_state().T_map_body.rotation());
    Eigen::VectorXd row(14);
    row << by_pose, Eigen::Vector3d::Zero(), c.by_intrinsics.transpose();
    pose.information += c.weight * by_pose * by_pose.transpose();
    pose.vector += c.weight * c.offset_px * by_pose;
    all.information += c.weight * row * row.transpose();
    all.vector += c.weight * c.offset_px * row;
    contours.push_back(c);
  }
  one_by_one.update(pose, contours);
  together.update(all);
  EXPECT_LT(one_by_one.state().minus(together.state()).norm(), 1e-9);
  const Eigen::MatrixXd P = one_by_one.filter().joint_covariance();
  EXPECT_LT((together.filter().joint_covariance() - P).norm(), 1e-9 * P.norm());
  EXPECT_LT((one_by_one.calibration().intrinsics - together.calibration().intrinsics).norm(), 1e-9);
  EXPECT_GT(together.calibration().intrinsics.norm(), 0);
}

/// Contours all around, of which all events come late by `delay_s` and those of a direction stand off alike.
std::vector<ContourOffset> late_contours(std::mt19937& random, const NavState& truth, const NavState& at,
                                         double delay_s, const Eigen::Matrix<double, 8, 1>& offsets_px) {
  std::normal_distribution<double> normal;
  std::vector<ContourOffset> out(60);
  for (std::size_t i = 0; i < out.size(); ++i) {
    ContourOffset& c = out[i];
    const auto direction = static_cast<Eigen::Index>(i % 8);
    c.normal_px = Eigen::Rotation2Dd(static_cast<double>(direction) * M_PI_4) * Eigen::Vector2d::UnitX();
    c.point_body = {normal(random), normal(random), 3 + 0.3 * normal(random)};
    c.across_body << 100 * c.normal_px, 0;
    c.darker = i % 3 == 0 ? -1 : 1;
    c.speed_px_s = 60 * c.normal_px.x() + 10 * normal(random);
    c.weight = 25;
    const auto dark = c.darker > 0 ? direction : (direction + 4) % 8;
    c.offset_px = c.by_pose(at.T_map_body.rotation()).dot(truth.T_map_body.minus(at.T_map_body)) +
                  delay_s * c.speed_px_s + c.darker * offsets_px(dark) + 0.2 * normal(random);
  }
  return out;
}

/// NEES/6 at the end of flights in which contours share errors of these sizes.
struct SharedErrorsNees {
  double own = 0, reported = 0;
};

SharedErrorsNees fly_with_shared_errors(double offset_sigma_px, double map_sigma_m,
                                        double concentration = 0) {
  std::mt19937 random(6);
  std::normal_distribution<double> normal;
  const StatePropagator propagator(MotionModel::constant_velocity, FusionConfig{}, ImuNoise{});
  SharedErrorsNees out;
  constexpr int kFlights = 200;
  for (int flight = 0; flight < kFlights; ++flight) {
    Ekf ekf(propagator);
    const NavState truth{{}, {0, 0, 0}};
    ekf.start(0, truth, {0, 0, 0});
    const double delay_s = 2e-3 * normal(random);
    Eigen::Matrix<double, 8, 1> offsets_px;
    for (double& offset : offsets_px) offset = offset_sigma_px * normal(random);
    for (int k = 1; k <= 100; ++k) {
      ekf.predict(k * 3 * kNsPerMs);
      PoseInformation pose;
      auto contours = late_contours(random, truth, ekf.state().nav, delay_s, offsets_px);
      for (ContourOffset& c : contours) {
        const Vector6d by_pose = c.by_pose(ekf.state().nav.T_map_body.rotation());
        c.sigma_m = map_sigma_m;
        c.concentration = concentration;
        pose.information += c.weight * by_pose * by_pose.transpose();
        pose.vector += c.weight * c.offset_px * by_pose;
      }
      ekf.update(pose, contours);
    }
    const Vector6d e = truth.T_map_body.minus(ekf.state().nav.T_map_body);
    out.own += e.dot(ekf.state().pose_covariance().ldlt().solve(e)) / 6 / kFlights;
    out.reported += e.dot(ekf.reported_state().pose_covariance().ldlt().solve(e)) / 6 / kFlights;
  }
  return out;
}

// A little cautious: nothing moves, while constant velocity allows that it does.
TEST(Ekf, ReportsACovarianceThatHoldsWithErrorsThatContoursShare) {
  const SharedErrorsNees nees = fly_with_shared_errors(0.08, 0);
  EXPECT_GT(nees.own, 2);
  EXPECT_GT(nees.reported, 0.7);
  EXPECT_LT(nees.reported, 1.2);
}

TEST(Ekf, ReportsACovarianceThatHoldsWithAMapWhoseFacesAreMisplaced) {
  // Three of the map's sigmas, at 100 px a metre.
  const SharedErrorsNees nees = fly_with_shared_errors(std::hypot(0.08, 0.6), 2e-3);
  EXPECT_GT(nees.own, 20);
  EXPECT_GT(nees.reported, 0.7);
  EXPECT_LT(nees.reported, 1.2);
}

TEST(Ekf, ReportsACovarianceThatHoldsWhereHalfOfTheEventsAreOfNoContour) {
  for (const SharedErrorsNees& nees : {fly_with_shared_errors(1.5 * 0.08, 0, 0.5),
                                       fly_with_shared_errors(3 * std::hypot(0.08, 0.6), 2e-3, 0.5)}) {
    EXPECT_GT(nees.own, 4);
    EXPECT_GT(nees.reported, 0.7);
    EXPECT_LT(nees.reported, 1.2);
  }
}

TEST(Ekf, ConstantVelocityLearnsTwistFromPosesAlone) {
  Ekf ekf(StatePropagator(MotionModel::constant_velocity, FusionConfig{}, ImuNoise{}));
  NavState nav;
  const Eigen::Vector3d velocity(0.5, 0, 0.1), rate(0, 0.3, 0.2);
  ekf.start(0, nav, {0, 0, 0});
  for (int k = 1; k <= 200; ++k) {
    const double t = k * 5e-3;
    ekf.predict(k * 5 * kNsPerMs);
    const Pose truth{so3::exp(rate * t), velocity * t};
    PoseInformation m;
    m.information = 1e8 * Matrix6d::Identity();
    m.vector = m.information * truth.minus(ekf.state().nav.T_map_body);
    ekf.update(m);
  }
  EXPECT_LT((ekf.state().nav.velocity - velocity).norm(), 2e-3);
  EXPECT_LT((ekf.state().angular_rate - rate).norm(), 2e-3);
}

}  // namespace
}  // namespace evpose
