// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/fusion/error_state_filter.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <random>

#include "evpose/fusion/fusion_config.h"

namespace evpose {
namespace {

Vector15d state_sigma() {
  Vector15d s;
  s << 2e-3, 2e-3, 2e-3, 2e-3, 2e-3, 2e-3, 0.05, 0.05, 0.05, 0.02, 0.02, 0.02, 0.1, 0.1, 0.1;
  return s;
}

Eigen::VectorXd numbers(std::initializer_list<double> values) {
  Eigen::VectorXd out(static_cast<Eigen::Index>(values.size()));
  std::copy(values.begin(), values.end(), out.data());
  return out;
}

class Draw {
 public:
  explicit Draw(unsigned seed) : random_(seed) {}
  double number() { return normal_(random_); }
  bool with(double probability) { return std::uniform_real_distribution<double>()(random_) < probability; }
  Eigen::VectorXd vector(Eigen::Index n) {
    return Eigen::VectorXd::NullaryExpr(n, [&] { return number(); });
  }
  Eigen::MatrixXd matrix(Eigen::Index rows, Eigen::Index cols) {
    return Eigen::MatrixXd::NullaryExpr(rows, cols, [&] { return number(); });
  }
  FusionState state() {
    FusionState s;
    s.nav.T_map_body = {so3::exp({0.3, -0.2, 1.1}), {1, 2, 3}};
    s.nav.velocity = {0.5, -1, 0.2};
    const Matrix15d root = Matrix15d::Identity() + 0.1 * matrix(15, 15);
    s.covariance = state_sigma().asDiagonal() * (root * root.transpose()) * state_sigma().asDiagonal();
    return s;
  }

 private:
  std::mt19937 random_;
  std::normal_distribution<double> normal_;
};

StatePropagator some_propagator() { return {MotionModel::imu, FusionConfig{}, ImuNoise{}}; }

ImuSample reading(TimeNs t) {
  const double s = to_seconds(t);
  return {t,
          {0.6 * std::sin(5 * s), 0.4 * std::cos(3 * s), 0.8},
          {1.5 * std::sin(4 * s), 1.2, 9.81 + std::cos(6 * s)}};
}

/// A sample as the tests draw it.
struct Sample {
  Vector6d by_pose;
  double weight, residual;
  std::vector<BlockRow> rows;
};

std::vector<Sample> draw_samples(Draw& draw, int count, const std::vector<std::pair<BlockId, int>>& blocks,
                                 double size = 1) {
  std::vector<Sample> out;
  for (int i = 0; i < count; ++i) {
    const Eigen::VectorXd by_pose = 200 * draw.vector(6);
    Sample s{by_pose, 4 + std::abs(draw.number()), size * draw.number(), {}};
    for (const auto& [id, n] : blocks)
      if (i < n || draw.with(0.7)) s.rows.push_back({id, 200 * draw.matrix(1, n)});
    out.push_back(s);
  }
  return out;
}

JointMeasurement joined(const std::vector<Sample>& samples, std::span<const PoseShift> shifts) {
  PoseInformation pose;
  for (const Sample& s : samples) {
    pose.information += s.weight * s.by_pose * s.by_pose.transpose();
    pose.vector += s.weight * s.residual * s.by_pose;
  }
  JointMeasurement out;
  out.start(pose, shifts);
  for (const Sample& s : samples)
    if (!s.rows.empty()) out.add({s.by_pose, s.weight, s.residual, s.rows});
  return out;
}

/// The textbook's filter on all states at once, in Joseph's form, with gains of considered states set to
/// zero.
struct Joint {
  Eigen::MatrixXd P;
  Eigen::VectorXd correction;

  void update(const std::vector<Sample>& samples, const ErrorStateFilter& filter,
              std::span<const PoseShift> shifts, const std::vector<Eigen::Index>& considered) {
    const auto count = static_cast<Eigen::Index>(samples.size());
    Eigen::MatrixXd C = Eigen::MatrixXd::Zero(count, P.rows());
    Eigen::VectorXd z(count), variance(count);
    for (Eigen::Index i = 0; i < count; ++i) {
      const Sample& s = samples[static_cast<std::size_t>(i)];
      C.row(i).head<6>() = s.by_pose;
      for (const PoseShift& shift : shifts)
        C.row(i).segment(15 + filter.at(shift.block), shift.by_block.cols()) =
            s.by_pose.transpose() * shift.by_block;
      for (const BlockRow& row : s.rows)
        C.row(i).segment(15 + filter.at(row.block), row.by_block.size()) += row.by_block;
      z(i) = s.residual;
      variance(i) = 1 / s.weight;
    }
    const Eigen::MatrixXd R = variance.asDiagonal();
    Eigen::MatrixXd K = P * C.transpose() * (C * P * C.transpose() + R).inverse();
    for (const Eigen::Index i : considered) K.row(i).setZero();
    const Eigen::MatrixXd left = Eigen::MatrixXd::Identity(P.rows(), P.rows()) - K * C;
    P = (left * P * left.transpose() + K * R * K.transpose()).eval();
    correction = K * z;
  }
};

double worst(const Eigen::MatrixXd& got, const Eigen::MatrixXd& expected) {
  const Eigen::VectorXd sigma = expected.diagonal().cwiseSqrt();
  return (got - expected).cwiseQuotient(sigma * sigma.transpose()).cwiseAbs().maxCoeff();
}

/// A filter with three blocks that are correlated with the state and with each other.
struct Mixed {
  explicit Mixed(unsigned seed) : draw(seed) {
    filter.reset_state(draw.state());
    shifting = filter.add_block(numbers({5e-3, 4e-3, 6e-3}));
    sampled = filter.add_block(numbers({3e-3, 2e-3}));
    offset = filter.add_block(Eigen::VectorXd::Constant(1, 4e-3));
    shift = {shifting, draw.matrix(6, 3)};
    for (const BlockId id : {shifting, sampled, offset})
      filter.add_effect(id, 0.2 * draw.matrix(15, filter.covariance(id).rows()));
  }
  std::vector<Sample> samples(int count, double size) {
    return draw_samples(draw, count, {{sampled, 2}, {offset, 1}}, size);
  }
  Draw draw;
  ErrorStateFilter filter;
  BlockId shifting, sampled, offset;
  PoseShift shift;
};

// --- the filter without blocks ---

/// The update of the 15-state filter, on matrices of known size.
void update_plain(FusionState& state, const PoseInformation& m) {
  const Matrix6d P = state.pose_covariance();
  const Eigen::Matrix<double, 15, 6> P_x = state.covariance.leftCols<6>();
  const Eigen::PartialPivLU<Matrix6d> lu(Matrix6d::Identity() + m.information * P);
  const Vector15d dx = P_x * lu.solve(m.vector);
  state.covariance -= (P_x * lu.solve(m.information) * P_x.transpose()).eval();
  state.covariance = (0.5 * (state.covariance + state.covariance.transpose())).eval();
  state.add(dx);
  Matrix15d G = Matrix15d::Identity();
  G.block<3, 3>(3, 3) = so3::right_jacobian(dx.segment<3>(3));
  state.covariance = (G * state.covariance * G.transpose()).eval();
  state.covariance = (0.5 * (state.covariance + state.covariance.transpose())).eval();
}

TEST(ErrorStateFilter, WithoutBlocksItIsThePlainFilterBitForBit) {
  Draw draw(1);
  FusionState plain = draw.state();
  ErrorStateFilter filter;
  filter.reset_state(plain);
  const StatePropagator propagator = some_propagator();
  for (int k = 0; k < 200; ++k) {
    const TimeNs t = k * 3 * kNsPerMs, next = t + 3 * kNsPerMs;
    propagator.propagate(plain, reading(t), reading(next));
    filter.propagate(propagator, reading(t), reading(next), ImuTrust::good);
    PoseInformation m;
    const Matrix6d root = draw.matrix(6, 6);
    m.information = 1e6 * root * root.transpose();
    m.vector = m.information * (1e-3 * draw.vector(6));
    update_plain(plain, m);
    JointMeasurement joint;
    joint.start(m);
    filter.update(joint);
    ASSERT_EQ(filter.state().covariance, plain.covariance) << k;
    ASSERT_EQ(filter.state().minus(plain).norm(), 0) << k;
  }
}

// --- joint updates ---

TEST(JointMeasurement, IsTheQuadraticOfItsSamples) {
  Draw draw(2);
  const std::vector<std::pair<BlockId, int>> blocks{{BlockId{4}, 2}, {BlockId{0}, 1}};
  const std::vector<Sample> samples = draw_samples(draw, 20, blocks);
  const JointMeasurement m = joined(samples, {});
  ASSERT_EQ(m.size(), 9);
  const auto cost = [&](const Eigen::VectorXd& y) {
    double sum = 0;
    for (const Sample& s : samples) {
      double rest = s.residual - s.by_pose.dot(y.head<6>());
      for (const BlockRow& row : s.rows)
        for (const JointMeasurement::Block& block : m.blocks())
          if (block.id == row.block) rest -= row.by_block.dot(y.segment(block.at, block.size));
      sum += 0.5 * s.weight * rest * rest;
    }
    return sum;
  };
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(9);
  const auto unit = [&](int i) -> Eigen::VectorXd { return 1e-3 * Eigen::VectorXd::Unit(9, i); };
  for (int i = 0; i < 9; ++i) {
    const double slope = (cost(unit(i)) - cost(-unit(i))) / 2e-3;
    EXPECT_NEAR(m.vector()(i), -slope, 1e-9 * m.vector().norm()) << i;
    for (int k = 0; k < 9; ++k) {
      const double bend = (cost(unit(i) + unit(k)) - cost(unit(i)) - cost(unit(k)) + cost(zero)) / 1e-6;
      EXPECT_NEAR(m.information()(i, k), bend, 1e-8 * m.information().norm()) << i << ' ' << k;
    }
  }
}

TEST(ErrorStateFilter, IsTheJointKalmanFilterOnRandomProblems) {
  for (unsigned seed = 0; seed < 30; ++seed) {
    Mixed mixed(seed);
    ErrorStateFilter& filter = mixed.filter;
    Joint joint{filter.joint_covariance(), {}};
    const FusionState before = filter.state();
    // Small residuals, so that the axes of the attitude's error do not turn.
    const auto samples = mixed.samples(12, 1e-5);
    const Eigen::MatrixXd prior = joint.P;
    joint.update(samples, filter, {&mixed.shift, 1}, {});
    filter.update(joined(samples, {&mixed.shift, 1}));
    EXPECT_LT(worst(filter.joint_covariance(), joint.P), 1e-6) << seed;
    const Eigen::VectorXd sigma = prior.diagonal().cwiseSqrt();
    Eigen::VectorXd got(21);
    got << filter.state().minus(before), filter.correction(mixed.shifting), filter.correction(mixed.sampled),
        filter.correction(mixed.offset);
    const Eigen::VectorXd error = (got - joint.correction).cwiseQuotient(sigma);
    EXPECT_LT(error.norm(), 1e-6 * joint.correction.cwiseQuotient(sigma).norm()) << seed;
  }
}

TEST(ErrorStateFilter, AnEffectIsThatOfTheJointTransition) {
  Mixed mixed(3);
  const Eigen::MatrixXd before = mixed.filter.joint_covariance(), by_block = mixed.draw.matrix(15, 2);
  Eigen::MatrixXd T = Eigen::MatrixXd::Identity(21, 21);
  T.block(0, 15 + mixed.filter.at(mixed.sampled), 15, 2) = by_block;
  mixed.filter.add_effect(mixed.sampled, by_block);
  EXPECT_LT(worst(mixed.filter.joint_covariance(), T * before * T.transpose()), 1e-12);
}

TEST(ErrorStateFilter, CorrelationsFollowTheMotion) {
  Mixed mixed(4);
  const StatePropagator propagator = some_propagator();
  const Eigen::MatrixXd before = mixed.filter.joint_covariance();
  FusionState state = mixed.filter.state();
  Matrix15d F;
  propagator.propagate(state, reading(0), reading(kNsPerMs), ImuTrust::good, &F);
  mixed.filter.propagate(propagator, reading(0), reading(kNsPerMs), ImuTrust::good);
  const Eigen::MatrixXd after = mixed.filter.joint_covariance();
  EXPECT_EQ(after.topLeftCorner(15, 15), state.covariance);
  EXPECT_EQ(after.bottomRightCorner(6, 6), before.bottomRightCorner(6, 6));
  const Eigen::MatrixXd expected = F * before.topRightCorner(15, 6);
  EXPECT_LT((after.topRightCorner(15, 6) - expected).norm(), 1e-12 * expected.norm());
}

TEST(ErrorStateFilter, TheSeenPoseIsAsUnsureAsPoseAndBlocksTogether) {
  Mixed mixed(5);
  const Eigen::MatrixXd P = mixed.filter.joint_covariance();
  Eigen::MatrixXd C = Eigen::MatrixXd::Zero(6, 21);
  C.leftCols<6>().setIdentity();
  C.middleCols(15 + mixed.filter.at(mixed.shifting), 3) = mixed.shift.by_block;
  C.middleCols(15 + mixed.filter.at(mixed.sampled), 2) = mixed.draw.matrix(6, 2);
  const PoseShift other{mixed.sampled, C.middleCols(15 + mixed.filter.at(mixed.sampled), 2)};
  const std::vector<PoseShift> shifts{mixed.shift, other};
  EXPECT_LT(worst(mixed.filter.seen_pose_covariance(shifts), C * P * C.transpose()), 1e-12);
  Eigen::MatrixXd all = Eigen::MatrixXd::Zero(11, 21);
  all.topRows<6>() = C;
  all.block<3, 3>(6, error_state::kV).setIdentity();
  all.block<2, 2>(9, 15 + mixed.filter.at(mixed.sampled)).setIdentity();
  EXPECT_LT(worst(mixed.filter.seen_covariance(shifts, &mixed.sampled), all * P * all.transpose()), 1e-12);
}

// --- blocks that come and go ---

TEST(ErrorStateFilter, ABlockAddedAndRemovedLeavesTheRestAsItIs) {
  Mixed mixed(6);
  const Eigen::MatrixXd before = mixed.filter.joint_covariance();
  const BlockId extra = mixed.filter.add_block(numbers({1, 2}));
  EXPECT_EQ(mixed.filter.joint_covariance().topLeftCorner(21, 21), before);
  EXPECT_EQ(mixed.filter.joint_covariance().topRightCorner(21, 2).norm(), 0);
  mixed.filter.remove_block(extra);
  EXPECT_EQ(mixed.filter.joint_covariance(), before);
}

TEST(ErrorStateFilter, RemovingACorrelatedBlockLeavesTheMarginalOfTheRest) {
  Mixed mixed(7);
  mixed.filter.update(joined(mixed.samples(12, 1), {&mixed.shift, 1}));
  const Eigen::MatrixXd before = mixed.filter.joint_covariance();
  const int at = 15 + mixed.filter.at(mixed.sampled);
  std::vector<int> rest;
  for (int i = 0; i < 21; ++i)
    if (i < at || i >= at + 2) rest.push_back(i);
  mixed.filter.remove_block(mixed.sampled);
  EXPECT_EQ(mixed.filter.joint_covariance(), Eigen::MatrixXd(before(rest, rest)));
  // A block of another size may take the name; those that stay keep theirs.
  const Eigen::MatrixXd offset = mixed.filter.covariance(mixed.offset);
  mixed.filter.add_block(Eigen::VectorXd::Constant(4, 1.0));
  EXPECT_EQ(mixed.filter.covariance(mixed.offset), offset);
}

TEST(ErrorStateFilter, ABlockThatNothingTellsOfChangesNothing) {
  Mixed with(8), without(8);
  const BlockId idle = with.filter.add_block(numbers({1, 2}));
  const auto samples = with.samples(12, 1);
  with.filter.update(joined(samples, {&with.shift, 1}));
  without.filter.update(joined(samples, {&without.shift, 1}));
  EXPECT_EQ(with.filter.correction(idle).norm(), 0);
  EXPECT_EQ(with.filter.covariance(idle), Eigen::MatrixXd(numbers({1, 4}).asDiagonal()));
  with.filter.remove_block(idle);
  EXPECT_LT(worst(with.filter.joint_covariance(), without.filter.joint_covariance()), 1e-12);
}

TEST(ErrorStateFilter, AResetBlockIsAsNew) {
  Mixed mixed(9);
  mixed.filter.reset_block(mixed.sampled, numbers({1, 2}));
  EXPECT_EQ(mixed.filter.covariance(mixed.sampled), Eigen::MatrixXd(numbers({1, 4}).asDiagonal()));
  Eigen::MatrixXd P = mixed.filter.joint_covariance();
  P.block(15 + mixed.filter.at(mixed.sampled), 15 + mixed.filter.at(mixed.sampled), 2, 2).setZero();
  EXPECT_EQ(P.middleCols(15 + mixed.filter.at(mixed.sampled), 2).norm(), 0);
}

// --- considered blocks ---

TEST(ErrorStateFilter, AConsideredBlockNeitherMovesNorLearns) {
  for (const bool sampled_too : {false, true}) {
    Mixed mixed(10);
    ErrorStateFilter& filter = mixed.filter;
    filter.set_considered(mixed.shifting, true);
    filter.set_considered(mixed.sampled, sampled_too);
    const Eigen::MatrixXd shifting = filter.covariance(mixed.shifting);
    for (int k = 0; k < 20; ++k) {
      filter.update(joined(mixed.samples(12, 1), {&mixed.shift, 1}));
      EXPECT_EQ(filter.correction(mixed.shifting).norm(), 0);
      EXPECT_EQ(filter.covariance(mixed.shifting), shifting);
      EXPECT_GT(filter.correction(mixed.offset).norm(), 0);
      EXPECT_EQ(filter.correction(mixed.sampled).norm() == 0, sampled_too);
    }
  }
}

TEST(ErrorStateFilter, ConsideringIsSchmidtsFilter) {
  for (unsigned seed = 0; seed < 10; ++seed) {
    Mixed mixed(seed);
    ErrorStateFilter& filter = mixed.filter;
    filter.set_considered(mixed.shifting, true);
    filter.set_considered(mixed.offset, true);
    std::vector<Eigen::Index> considered{15 + filter.at(mixed.offset)};
    for (int i = 0; i < 3; ++i) considered.push_back(15 + filter.at(mixed.shifting) + i);
    Joint joint{filter.joint_covariance(), {}};
    const auto samples = mixed.samples(12, 1e-5);
    joint.update(samples, filter, {&mixed.shift, 1}, considered);
    filter.update(joined(samples, {&mixed.shift, 1}));
    EXPECT_LT(worst(filter.joint_covariance(), joint.P), 1e-6) << seed;
  }
}

// --- errors that measurements share ---

/// A filter and the values of its blocks, whose true values are zero, on a flight whose true state is known.
struct Flown {
  Mixed mixed;
  Eigen::VectorXd values = Eigen::VectorXd::Zero(6);

  /// An update by samples without noise whose residuals are `px` too large.
  void update(const std::vector<Sample>& drawn, const FusionState& truth, const std::vector<double>& px,
              double share) {
    ErrorStateFilter& filter = mixed.filter;
    Vector6d seen = truth.minus(filter.state()).head<6>();
    seen -= mixed.shift.by_block * values.segment<3>(filter.at(mixed.shifting));
    std::vector<Sample> samples = drawn;
    for (std::size_t i = 0; i < samples.size(); ++i) {
      samples[i].residual = samples[i].by_pose.dot(seen) + share * px[i];
      for (const BlockRow& row : samples[i].rows)
        samples[i].residual -= row.by_block.dot(values.segment(filter.at(row.block), row.by_block.size()));
    }
    JointMeasurement m = joined(samples, {&mixed.shift, 1});
    m.expect_shared_errors(1);
    for (std::size_t i = 0; i < samples.size(); ++i)
      m.add_shared_error(0, px[i], {samples[i].by_pose, samples[i].weight, 0, samples[i].rows});
    filter.update(m);
    for (const BlockId id : {mixed.shifting, mixed.sampled, mixed.offset})
      values.segment(filter.at(id), filter.covariance(id).rows()) += filter.correction(id);
  }
};

TEST(ErrorStateFilter, FollowsASharedErrorAsDifferencesSay) {
  constexpr double kShare = 1e-4;
  Flown without{Mixed(11)}, with{Mixed(11)};
  Draw draw(12);
  FusionState truth = without.mixed.filter.state();
  truth.add(1e-6 * draw.vector(15));
  const StatePropagator propagator = some_propagator();
  for (Flown* flown : {&without, &with}) {
    flown->mixed.filter.set_considered(flown->mixed.offset, true);
    flown->mixed.filter.follow_shared_errors(1);
  }
  for (int k = 0; k < 6; ++k) {
    const std::vector<Sample> samples = without.mixed.samples(12, 1);
    const Eigen::VectorXd px = draw.vector(12);
    const std::vector<double> each(px.begin(), px.end());
    without.update(samples, truth, each, 0);
    with.update(samples, truth, each, kShare);
    const ImuSample from = reading(k * kNsPerMs), to = reading((k + 1) * kNsPerMs);
    propagator.propagate(truth, from, to, ImuTrust::good);
    for (Flown* flown : {&without, &with})
      flown->mixed.filter.propagate(propagator, from, to, ImuTrust::good);
  }
  const Vector15d moved = with.mixed.filter.state().minus(without.mixed.filter.state()) / kShare;
  const Matrix15d expected = moved * moved.transpose();
  EXPECT_LT((without.mixed.filter.shared_covariance() - expected).norm(), 1e-3 * expected.norm());
  EXPECT_GT(moved.head<3>().norm(), 1e-4);
}

TEST(ErrorStateFilter, ASharedErrorDoesNotAverageOut) {
  const double sigma_m = 0.01, weight = 4, by_x = 200, px = 0.2;
  ErrorStateFilter filter;
  FusionState state;
  state.covariance.diagonal().setConstant(sigma_m * sigma_m);
  filter.reset_state(state);
  filter.follow_shared_errors(1);
  const Vector6d by_pose = by_x * Vector6d::Unit(0);
  for (int n = 1; n <= 1000; ++n) {
    JointMeasurement m;
    m.start({weight * by_pose * by_pose.transpose(), Vector6d::Zero()});
    m.expect_shared_errors(1);
    m.add_shared_error(0, px, {by_pose, weight, 0, {}});
    filter.update(m);
    const double told = n * weight * by_x * by_x * sigma_m * sigma_m;
    const double expected = px / by_x * told / (1 + told);
    ASSERT_NEAR(std::sqrt(filter.shared_covariance()(0, 0)), expected, 1e-9 * expected) << n;
  }
  EXPECT_GT(filter.shared_covariance()(0, 0), 100 * filter.state().covariance(0, 0));
  filter.reset_state(state);
  EXPECT_EQ(filter.shared_covariance().norm(), 0);
}

TEST(ErrorStateFilter, CovarianceStaysPositiveSemiDefinite) {
  Mixed mixed(11);
  ErrorStateFilter& filter = mixed.filter;
  const StatePropagator propagator = some_propagator();
  for (int k = 0; k < 10000; ++k) {
    const TimeNs t = filter.state().t, next = t + (mixed.draw.with(0.5) ? 1 : 5) * kNsPerMs;
    filter.propagate(propagator, reading(t), reading(next), ImuTrust::good);
    for (const BlockId id : {mixed.shifting, mixed.sampled, mixed.offset})
      if (mixed.draw.with(0.05)) filter.set_considered(id, mixed.draw.with(0.5));
    if (mixed.draw.with(0.01)) filter.reset_block(mixed.offset, Eigen::VectorXd::Constant(1, 4e-3));
    if (mixed.draw.with(0.01)) {
      filter.remove_block(mixed.sampled);
      mixed.sampled = filter.add_block(numbers({3e-3, 2e-3}));
    }
    if (mixed.draw.with(0.5)) filter.update(joined(mixed.samples(4, 0.3), {&mixed.shift, 1}));
    if (k % 20 != 0) continue;
    const Eigen::MatrixXd P = filter.joint_covariance();
    ASSERT_GT(P.diagonal().minCoeff(), 0) << k;
    const Eigen::VectorXd scale = P.diagonal().cwiseSqrt().cwiseInverse();
    const Eigen::MatrixXd correlation = scale.asDiagonal() * P * scale.asDiagonal();
    const double least = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(correlation).eigenvalues().minCoeff();
    ASSERT_GT(least, -1e-9) << k;
  }
}

}  // namespace
}  // namespace evpose
