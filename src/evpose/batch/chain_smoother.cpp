// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/batch/chain_smoother.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>

#include "evpose/core/error.h"

namespace evpose {
namespace {

Matrix15d symmetric(const Matrix15d& m) { return 0.5 * (m + m.transpose()); }

/// P F^T (P')^-1; states without uncertainty stay as they are.
Matrix15d smoother_gain(const Matrix15d& covariance, const Matrix15d& transition,
                        const Matrix15d& predicted) {
  constexpr double kRelative = 1e-13, kNothing = 1e-30;
  Matrix15d damped = predicted;
  damped.diagonal() += kRelative * predicted.diagonal() + Vector15d::Constant(kNothing);
  return damped.ldlt().solve(transition * covariance).transpose();
}

}  // namespace

void ParameterInformation::grow(Eigen::Index n) {
  const Eigen::Index old = s.size();
  if (n <= old) return;
  S.conservativeResize(n, n);
  S.rightCols(n - old).setZero();
  S.bottomRows(n - old).setZero();
  s.conservativeResize(n);
  s.tail(n - old).setZero();
}

void ParameterInformation::add(const ParameterInformation& other) {
  grow(other.s.size());
  S.topLeftCorner(other.s.size(), other.s.size()) += other.S;
  s.head(other.s.size()) += other.s;
}

void ChainSmoother::start(const Vector15d& mean, const Matrix15d& covariance) {
  mean_ = mean;
  covariance_ = covariance;
  by_parameters_.resize(15, 0);
  parameters_ = {};
  gathered_ = 0;
  left_.resize(kGathered, 0);
  right_.resize(kGathered, 0);
  knots_.clear();
  knots_.emplace_back();
}

/// Parameters that nothing has depended on until now.
void ChainSmoother::grow(Eigen::Index n) {
  const Eigen::Index old = by_parameters_.cols();
  if (n <= old) return;
  for (Eigen::MatrixXd* m : {&left_, &right_}) {
    m->conservativeResize(kGathered, n);
    m->rightCols(n - old).setZero();
  }
  by_parameters_.conservativeResize(Eigen::NoChange, n);
  by_parameters_.rightCols(n - old).setZero();
  parameters_.grow(n);
}

/// Single products of few rows would take most of the time, to and from memory.
void ChainSmoother::add_gathered() {
  const auto left = left_.topRows(gathered_), right = right_.topRows(gathered_);
  parameters_.S.triangularView<Eigen::Lower>() += left.transpose() * right;
  parameters_.S.triangularView<Eigen::StrictlyUpper>() = parameters_.S.transpose();
  gathered_ = 0;
}

const ParameterInformation& ChainSmoother::parameters() {
  if (gathered_ > 0) add_gathered();
  return parameters_;
}

void ChainSmoother::measure(const ChainMeasurement& m) {
  const auto count = static_cast<Eigen::Index>(m.parameters.size());
  EVPOSE_CHECK(m.information.rows() == 6 + count && m.vector.size() == 6 + count);
  Eigen::Index n = by_parameters_.cols();
  for (const int p : m.parameters) n = std::max<Eigen::Index>(n, p + 1);
  grow(n);

  const Matrix6d H = m.information.topLeftCorner<6, 6>();
  Eigen::MatrixXd mixed = Eigen::MatrixXd::Zero(6, n);
  for (Eigen::Index i = 0; i < count; ++i)
    mixed.col(m.parameters[static_cast<std::size_t>(i)]) += m.information.block<6, 1>(0, 6 + i);
  const Eigen::MatrixXd L = by_parameters_.topRows<6>();
  const Eigen::MatrixXd V = mixed + H * L;
  const Vector6d g = m.vector.head<6>() - H * mean_.head<6>();
  const Matrix6d P = covariance_.topLeftCorner<6, 6>();
  const Eigen::PartialPivLU<Matrix6d> lu(Matrix6d::Identity() + H * P);
  // Of the pose after the measurement, for known parameters.
  const Matrix6d after = lu.solve(Matrix6d::Identity()).transpose() * P;

  const Eigen::MatrixXd after_V = after * V;
  if (gathered_ + 18 > kGathered) add_gathered();
  left_.middleRows<18>(gathered_) << L, mixed, -after_V;
  right_.middleRows<18>(gathered_) << V, L, V;
  gathered_ += 18;
  parameters_.s += L.transpose() * g - mixed.transpose() * mean_.head<6>() - V.transpose() * (after * g);
  for (Eigen::Index j = 0; j < count; ++j) {
    const int column = m.parameters[static_cast<std::size_t>(j)];
    parameters_.s(column) += m.vector(6 + j);
    for (Eigen::Index i = 0; i < count; ++i)
      parameters_.S(m.parameters[static_cast<std::size_t>(i)], column) += m.information(6 + i, 6 + j);
  }

  const Eigen::Matrix<double, 15, 6> P_pose = covariance_.leftCols<6>();
  mean_ += P_pose * lu.solve(g);
  by_parameters_ -= P_pose * lu.solve(V);
  covariance_ = symmetric(covariance_ - P_pose * lu.solve(H) * P_pose.transpose());
}

void ChainSmoother::move(const Matrix15d& transition, const Vector15d& offset, const Matrix15d& noise,
                         const Eigen::Ref<const Eigen::MatrixXd>& by_parameters) {
  Knot& knot = knots_.back();
  knot.mean = mean_;
  knot.covariance = covariance_;
  knot.by_parameters = by_parameters_.cast<float>();
  knot.transition = transition;
  knot.offset = offset;
  knot.moved_by_parameters = by_parameters;
  mean_ = (transition * mean_ - offset).eval();
  covariance_ = symmetric(transition * covariance_ * transition.transpose() + noise);
  by_parameters_ = (transition * by_parameters_).eval();
  grow(by_parameters.cols());
  by_parameters_.leftCols(by_parameters.cols()) += by_parameters;
  knot.predicted_covariance = covariance_;
  knots_.emplace_back();
}

std::vector<ChainSmoother::Smoothed> ChainSmoother::smooth(const Eigen::VectorXd& z,
                                                           const Eigen::MatrixXd& z_covariance) const {
  EVPOSE_CHECK(!knots_.empty() && z.size() >= by_parameters_.cols());
  const Eigen::Index n = z.size();
  std::vector<Smoothed> out(knots_.size());
  ByParameters L = ByParameters::Zero(15, n);
  L.leftCols(by_parameters_.cols()) = by_parameters_;
  Vector15d mean = mean_ + L * z;
  Matrix15d covariance = covariance_;
  for (std::size_t k = knots_.size(); k-- > 0;) {
    if (k + 1 < knots_.size()) {
      const Knot& knot = knots_[k];
      const Matrix15d gain = smoother_gain(knot.covariance, knot.transition, knot.predicted_covariance);
      const ByParameters own = knot.by_parameters.cast<double>();
      ByParameters ahead = L;
      ahead.leftCols(own.cols()) -= knot.transition * own;
      ahead.leftCols(knot.moved_by_parameters.cols()) -= knot.moved_by_parameters;
      const Vector15d filtered = knot.mean + own * z.head(own.cols());
      const Vector15d predicted = knot.transition * filtered - knot.offset +
                                  knot.moved_by_parameters * z.head(knot.moved_by_parameters.cols());
      mean = filtered + gain * (mean - predicted);
      covariance =
          symmetric(knot.covariance + gain * (covariance - knot.predicted_covariance) * gain.transpose());
      L = gain * ahead;
      L.leftCols(own.cols()) += own;
    }
    out[k].mean = mean;
    out[k].covariance =
        z_covariance.size() == 0 ? covariance : symmetric(covariance + L * z_covariance * L.transpose());
  }
  return out;
}

}  // namespace evpose
