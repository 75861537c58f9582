// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_learn/joint_adjustment.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <random>

namespace evpose::map_learn {
namespace {

/// A flight of a few knots that sees landmarks; everything drawn. `share`: two of three landmarks stand on
/// what others stand on.
AdjustmentProblem drawn_problem(unsigned seed, std::size_t knots, std::size_t landmarks, bool share = false) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  const auto vector = [&](double scale) {
    return Eigen::Vector3d(scale * normal(random), scale * normal(random), scale * normal(random));
  };
  AdjustmentProblem p;
  for (std::size_t k = 0; k + 1 < knots; ++k) {
    KnotStep step;
    step.transition.block<3, 3>(0, 6) = 0.1 * Eigen::Matrix3d::Identity();
    step.noise = 1e-4 * Matrix15d::Identity();
    for (int i = 0; i < 15; ++i) step.offset(i) = 1e-3 * normal(random);
    p.steps.push_back(step);
  }
  p.start_covariance *= 0.01;
  for (int i = 0; i < 15; ++i) p.start_offset(i) = 1e-2 * std::sin(i);
  for (std::size_t j = 0; j < landmarks; ++j) {
    Landmark l;
    const Eigen::Vector3d tangent = vector(1).normalized();
    l.directions.col(0) = tangent.unitOrthogonal();
    l.directions.col(1) = tangent.cross(l.directions.col(0));
    l.moved_m = {1e-3 * normal(random), 1e-3 * normal(random)};
    l.sigma_m = {4e-3, 1e-3};
    if (share && j % 3 != 0) l.shared = {{0, vector(1)}, {static_cast<Eigen::Index>(j % 3), vector(1)}};
    p.landmarks.push_back(l);
    for (std::size_t i = 0; i < 8; ++i) {
      Observation o;
      o.landmark = static_cast<std::uint32_t>(j);
      o.knot = static_cast<std::uint32_t>(i % (knots - 1));
      o.share = static_cast<double>(i) / 8;
      o.by_pose << vector(150), vector(400);
      o.by_point = vector(150);
      o.offset_px = normal(random);
      o.forward = i % 2 == 0 ? 1 : -1;
      o.variance_px2 = o.scatter_px2 = 0.05;
      p.observations.push_back(o);
    }
  }
  if (share) {
    p.shared = Eigen::Vector3d(1e-3, -2e-3, 0.5e-3);
    p.shared_covariance = 4e-6 * Eigen::Matrix3d::Identity();
    p.shared_covariance(0, 1) = p.shared_covariance(1, 0) = 1e-6;
  }
  return p;
}

/// Normal equations of all unknowns: knots, delay, landmarks (two across, delay), what these share.
struct Dense {
  explicit Dense(const AdjustmentProblem& p)
      : delay(15 * static_cast<int>(p.knots())),
        landmarks(delay + 1),
        shared(landmarks + 3 * static_cast<int>(p.landmarks.size())),
        H(Eigen::MatrixXd::Zero(shared + p.shared.size(), shared + p.shared.size())),
        b(Eigen::VectorXd::Zero(H.rows())) {
    const auto add = [&](const Eigen::MatrixXd& J, const Eigen::VectorXd& r, const Eigen::MatrixXd& W) {
      H += J.transpose() * W * J;
      b += J.transpose() * W * r;
    };
    const auto prior = [&](int at, double value, double sigma) {
      Eigen::MatrixXd J = Eigen::MatrixXd::Zero(1, H.rows());
      J(0, at) = 1;
      add(J, Eigen::VectorXd::Constant(1, value), Eigen::MatrixXd::Constant(1, 1, 1 / (sigma * sigma)));
    };
    for (int i = 0; i < 15; ++i) prior(i, -p.start_offset(i), std::sqrt(p.start_covariance(i, i)));
    for (int k = 0; k < static_cast<int>(p.steps.size()); ++k) {
      Eigen::MatrixXd J = Eigen::MatrixXd::Zero(15, H.rows());
      J.block<15, 15>(0, 15 * k) = -p.steps[static_cast<std::size_t>(k)].transition;
      J.block<15, 15>(0, 15 * k + 15).setIdentity();
      add(J, -p.steps[static_cast<std::size_t>(k)].offset,
          p.steps[static_cast<std::size_t>(k)].noise.inverse());
    }
    prior(delay, 0, p.delay_sigma_px);
    Eigen::MatrixXd of_shared = Eigen::MatrixXd::Zero(p.shared.size(), H.rows());
    of_shared.rightCols(p.shared.size()).setIdentity();
    add(of_shared, -p.shared, p.shared_covariance.inverse());
    for (int j = 0; j < static_cast<int>(p.landmarks.size()); ++j) {
      const Landmark& l = p.landmarks[static_cast<std::size_t>(j)];
      for (int d = 0; d < 2; ++d) {
        Eigen::MatrixXd J = Eigen::MatrixXd::Zero(1, H.rows());
        J(0, landmarks + 3 * j + d) = 1;
        double off = l.moved_m(d);
        for (const auto& [number, by_unit] : l.shared) {
          J(0, shared + number) -= l.directions.col(d).dot(by_unit);
          off -= l.directions.col(d).dot(by_unit) * p.shared(number);
        }
        add(J, Eigen::VectorXd::Constant(1, -off),
            Eigen::MatrixXd::Constant(1, 1, 1 / (l.sigma_m(d) * l.sigma_m(d))));
      }
      prior(landmarks + 3 * j + 2, 0, p.own_delay_sigma_px);
    }
    for (const Observation& o : p.observations) {
      const Landmark& l = p.landmarks[o.landmark];
      Eigen::MatrixXd J = Eigen::MatrixXd::Zero(1, H.rows());
      const int knot = 15 * static_cast<int>(o.knot), own = landmarks + 3 * static_cast<int>(o.landmark);
      J.block<1, 6>(0, knot) = (1 - o.share) * o.by_pose.transpose();
      J.block<1, 6>(0, knot + 15) = o.share * o.by_pose.transpose();
      J(0, delay) = J(0, own + 2) = o.forward;
      J.block<1, 2>(0, own) = o.by_point.transpose() * l.directions;
      add(J, Eigen::VectorXd::Constant(1, o.offset_px), Eigen::MatrixXd::Constant(1, 1, 1 / o.variance_px2));
    }
  }
  int delay, landmarks, shared;
  Eigen::MatrixXd H;
  Eigen::VectorXd b;
};

TEST(JointAdjustment, EliminationSolvesTheFullNormalEquations) {
  const AdjustmentProblem p = drawn_problem(1, 5, 30, true);
  const Dense dense(p);
  const Eigen::VectorXd x = dense.H.ldlt().solve(dense.b);
  const Eigen::MatrixXd covariance = dense.H.inverse();
  const AdjustmentResult result = adjust(p, std::vector<Eigen::Matrix3d>(5, Eigen::Matrix3d::Identity()), 0);
  for (int k = 0; k < 5; ++k) {
    EXPECT_LT((result.states[static_cast<std::size_t>(k)] - x.segment<15>(15 * k)).norm(), 1e-9);
    EXPECT_LT((result.pose_covariances[static_cast<std::size_t>(k)] - covariance.block<6, 6>(15 * k, 15 * k))
                  .norm(),
              1e-12);
  }
  EXPECT_NEAR(result.delay_px, x(dense.delay), 1e-9);
  EXPECT_LT((result.shared - p.shared - x.tail<3>()).norm(), 1e-10);
  for (int j = 0; j < 30; ++j) {
    const LandmarkEstimate& e = result.landmarks[static_cast<std::size_t>(j)];
    const int at = dense.landmarks + 3 * j;
    EXPECT_LT((e.move_m - x.segment<2>(at)).norm(), 1e-10);
    EXPECT_NEAR(e.delay_px, x(at + 2), 1e-9);
    EXPECT_LT((e.covariance - covariance.block<2, 2>(at, at)).norm(), 1e-12);
    EXPECT_EQ(e.observations, 8);
  }
}

TEST(JointAdjustment, CommonCovarianceIsThatOfTheMeanPose) {
  const AdjustmentProblem p = drawn_problem(2, 4, 20);
  const Dense dense(p);
  const Eigen::MatrixXd covariance = dense.H.inverse();
  Eigen::MatrixXd mean = Eigen::MatrixXd::Zero(6, covariance.rows());
  for (int k = 0; k < 4; ++k) mean.block<6, 6>(0, 15 * k) = 0.25 * Matrix6d::Identity();
  const AdjustmentResult result = adjust(p, std::vector<Eigen::Matrix3d>(4, Eigen::Matrix3d::Identity()), 0);
  EXPECT_LT((result.common_covariance - mean * covariance * mean.transpose()).norm(), 1e-12);
}

/// Observations that a known trajectory error and known places of the landmarks would make.
struct Known {
  std::vector<Vector15d> states;
  std::vector<Eigen::Vector2d> landmarks;
  Eigen::Vector3d shared = Eigen::Vector3d::Zero();
};

/// `elsewhere`: by which every fourth landmark stands off, map frame.
Known make_consistent(AdjustmentProblem& p, unsigned seed, double noise_px,
                      const Eigen::Vector3d& elsewhere = Eigen::Vector3d::Zero()) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  Known known;
  for (std::size_t k = 0; k < p.knots(); ++k) {
    Vector15d d = Vector15d::Zero();
    for (int i = 0; i < 3; ++i) d(i) = 3e-3 * normal(random), d(3 + i) = 1e-3 * normal(random);
    known.states.push_back(d);
  }
  for (std::size_t k = 0; k + 1 < p.knots(); ++k)
    p.steps[k].offset = p.steps[k].transition * known.states[k] - known.states[k + 1];
  p.start_covariance.setIdentity();
  p.start_offset.setZero();
  if (p.shared.size() > 0) {
    p.shared.setZero();
    p.shared_covariance = 25e-6 * Eigen::Matrix3d::Identity();
    for (double& value : known.shared) value = 5e-3 * normal(random);
  }
  for (Landmark& l : p.landmarks) {
    known.landmarks.emplace_back(2e-3 * normal(random), 0.5e-3 * normal(random));
    for (const auto& [number, by_unit] : l.shared)
      known.landmarks.back() += known.shared(number) * (l.directions.transpose() * by_unit);
    l.moved_m.setZero();
    l.sigma_m = {2e-3, 0.5e-3};
    if (known.landmarks.size() % 4 == 0) known.landmarks.back() += l.directions.transpose() * elsewhere;
  }
  for (Observation& o : p.observations) {
    const Vector6d pose =
        (1 - o.share) * known.states[o.knot].head<6>() + o.share * known.states[o.knot + 1].head<6>();
    const Eigen::Vector3d moved = p.landmarks[o.landmark].directions * known.landmarks[o.landmark];
    o.offset_px = o.by_pose.dot(pose) + o.by_point.dot(moved) + noise_px * normal(random);
    o.variance_px2 = o.scatter_px2 = noise_px * noise_px;
  }
  return known;
}

TEST(JointAdjustment, ShiftedContoursAndTrajectoryComeBackWithinTheirSigma) {
  double square = 0, count = 0;
  for (unsigned seed = 0; seed < 10; ++seed) {
    AdjustmentProblem p = drawn_problem(seed, 6, 60);
    const Known known = make_consistent(p, 100 + seed, 0.2);
    const AdjustmentResult result =
        adjust(p, std::vector<Eigen::Matrix3d>(6, Eigen::Matrix3d::Identity()), 0);
    for (std::size_t j = 0; j < 60; ++j) {
      const Eigen::Vector2d e = result.landmarks[j].move_m - known.landmarks[j];
      square += e.dot(result.landmarks[j].covariance.inverse() * e) / 2;
      ++count;
    }
    for (std::size_t k = 0; k < 6; ++k)
      EXPECT_LT((result.states[k] - known.states[k]).head<3>().norm(), 2e-3) << seed << ", knot " << k;
  }
  EXPECT_GT(square / count, 0.8);
  EXPECT_LT(square / count, 1.2);
}

TEST(JointAdjustment, WhatLandmarksShareComesBackWithinItsSigma) {
  double square = 0, off = 0, off_if_not_known_to_be_shared = 0;
  constexpr unsigned kSeeds = 60;
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    AdjustmentProblem p = drawn_problem(seed, 6, 60, true);
    const Known known = make_consistent(p, 300 + seed, 0.2);
    const std::vector<Eigen::Matrix3d> rotations(6, Eigen::Matrix3d::Identity());
    const auto mean_off = [&known](const AdjustmentResult& result) {
      double sum = 0;
      for (std::size_t k = 0; k < 6; ++k) sum += (result.states[k] - known.states[k]).head<3>().norm() / 6;
      return sum;
    };
    const AdjustmentResult result = adjust(p, rotations, 0);
    const Eigen::MatrixXd covariance = Dense(p).H.inverse();
    const Eigen::Vector3d e = result.shared - known.shared;
    square += e.dot(covariance.bottomRightCorner<3, 3>().inverse() * e) / 3;
    off += mean_off(result);
    for (Landmark& l : p.landmarks) l.shared.clear();
    off_if_not_known_to_be_shared += mean_off(adjust(p, rotations, 0));
  }
  EXPECT_GT(square / kSeeds, 0.7);
  EXPECT_LT(square / kSeeds, 1.3);
  EXPECT_LT(off, 0.5 * off_if_not_known_to_be_shared);
}

TEST(JointAdjustment, ContoursOnAnotherEdgePullTheTrajectoryOnlyWhereNothingIsDoubted) {
  double doubting = 0, believing = 0, place = 0;
  for (unsigned seed = 0; seed < 10; ++seed) {
    AdjustmentProblem p = drawn_problem(seed, 6, 60);
    const Known known = make_consistent(p, 100 + seed, 0.2, {0.03, 0, 0});
    const std::vector<Eigen::Matrix3d> rotations(6, Eigen::Matrix3d::Identity());
    const AdjustmentResult robust = adjust(p, rotations), plain = adjust(p, rotations, 0);
    for (std::size_t k = 0; k < 6; ++k) {
      doubting += (robust.states[k] - known.states[k]).head<3>().norm() / 60;
      believing += (plain.states[k] - known.states[k]).head<3>().norm() / 60;
    }
    for (std::size_t j = 3; j < 60; j += 4)
      place += (robust.landmarks[j].move_m - known.landmarks[j]).norm() / 150;
  }
  EXPECT_GT(believing, 1.2e-3);
  EXPECT_LT(doubting, 0.5 * believing);
  EXPECT_LT(place, 3e-3);  // they are found where they stand, 30 mm off
}

}  // namespace
}  // namespace evpose::map_learn
