// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/fusion/window.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "evpose/core/error.h"

namespace evpose {

using namespace error_state;

namespace {

// Standard deviations below these count as these: the information form cannot hold a zero.
Vector15d least_sigma() {
  Vector15d s;
  s << Eigen::Vector3d::Constant(1e-9), Eigen::Vector3d::Constant(1e-9), Eigen::Vector3d::Constant(1e-8),
      Eigen::Vector3d::Constant(1e-8), Eigen::Vector3d::Constant(1e-7);
  return s;
}

Matrix15d information_of(Matrix15d covariance) {
  covariance.diagonal() += least_sigma().cwiseAbs2();
  const Vector15d scale = covariance.diagonal().cwiseSqrt().cwiseInverse();
  const Matrix15d correlation = scale.asDiagonal() * covariance * scale.asDiagonal();
  const Matrix15d inverse = correlation.ldlt().solve(Matrix15d::Identity());
  return scale.asDiagonal() * (0.5 * (inverse + inverse.transpose())) * scale.asDiagonal();
}

}  // namespace

void Window::start(const FusionState& first) {
  nodes_.clear();
  nodes_.push_back({first, Preintegration(first.gyro_bias, first.accel_bias), {}, first.nav.T_map_body});
  prior_at_ = first;
  prior_information_ = information_of(first.covariance);
  prior_vector_.setZero();
  fused_ = 0;
  fused_information_ = prior_information_;
}

void Window::add(const Preintegration& motion, const FusionState& state, const PoseInformation& measurement,
                 const Pose& measured_at) {
  EVPOSE_CHECK(!nodes_.empty());
  nodes_.push_back({state, motion, measurement, measured_at});
}

void Window::add_measurement(const PoseInformation& measurement, const Pose& measured_at) {
  Node& newest = nodes_.back();
  const PoseInformation m = moved(measurement, measured_at, newest.measured_at);
  newest.measurement.information += m.information;
  newest.measurement.vector += m.vector;
}

/// Eq. (3) of a node, in that place of the chain.
void Window::add_measured(std::size_t node, std::size_t place) {
  const Node& n = nodes_[node];
  const PoseInformation m = moved(n.measurement, n.measured_at, n.state.nav.T_map_body);
  chain_.diagonal(place).topLeftCorner<6, 6>() += m.information;
  chain_.vector(place).head<6>() += m.vector;
}

/// Eq. (4) and (2) between a node and the one before it, in that place of the chain and the one before it.
void Window::add_motion(std::size_t node, std::size_t place) {
  const auto add = [&](const auto& r, const auto& W) {
    const auto start_W = (r.by_start.transpose() * W).eval(), end_W = (r.by_end.transpose() * W).eval();
    chain_.diagonal(place - 1) += start_W * r.by_start;
    chain_.diagonal(place) += end_W * r.by_end;
    chain_.below(place) += end_W * r.by_start;
    chain_.vector(place - 1) -= start_W * r.value;
    chain_.vector(place) -= end_W * r.value;
  };
  const FusionState &start = nodes_[node - 1].state, &end = nodes_[node].state;
  const Preintegration& motion = nodes_[node].motion;
  add(motion.residual(start, end, gravity_map_), information_of(motion.covariance()));
  if (!prior_ || end.t <= start.t) return;
  const MotionPrior::Matrix9d covariance = prior_->covariance(to_seconds(end.t - start.t));
  add(prior_->residual(start, end), MotionPrior::Matrix9d(covariance.inverse()));
}

void Window::linearise(std::size_t count, bool newest_measured) {
  chain_.resize(count);
  const Vector15d d = nodes_[0].state.minus(prior_at_);
  Matrix15d J = Matrix15d::Identity();
  J.block<3, 3>(kPhi, kPhi) = so3::right_jacobian_inverse(d.segment<3>(kPhi));
  chain_.diagonal(0) += J.transpose() * prior_information_ * J;
  chain_.vector(0) += J.transpose() * (prior_vector_ - prior_information_ * d);
  for (std::size_t i = 0; i < count; ++i) {
    if (newest_measured || i + 1 < count) add_measured(i, i);
    if (i > 0) add_motion(i, i);
  }
}

bool Window::fuse_newest() {
  const std::size_t first = fused_, newest = nodes_.size() - 1;
  EVPOSE_CHECK(first < newest);
  chain_.resize(newest - first + 1);
  chain_.diagonal(0) += fused_information_;
  for (std::size_t i = first + 1; i <= newest; ++i) {
    add_motion(i, i - first);
    add_measured(i, i - first);
  }
  if (!chain_.eliminate()) return false;
  nodes_.back().state.add(chain_.solve().back());
  take_newest();
  return true;
}

/// What the chain has said of the newest state.
void Window::take_newest() {
  Vector15d vector;
  nodes_.back().state.covariance = chain_.newest_covariance();
  chain_.marginal(chain_.size() - 1, &fused_information_, &vector);
  fused_ = nodes_.size() - 1;
}

bool Window::optimise(int iterations) {
  const std::deque<Node> before = nodes_;
  for (int k = 0; k < iterations; ++k) {
    linearise(nodes_.size(), true);
    if (!chain_.eliminate()) {
      nodes_ = before;
      return false;
    }
    const std::vector<Vector15d> step = chain_.solve();
    for (std::size_t i = 0; i < nodes_.size(); ++i) nodes_[i].state.add(step[i]);
  }
  take_newest();
  return true;
}

void Window::forget_before(TimeNs t) {
  std::size_t gone = 0;
  while (gone + 1 < nodes_.size() && nodes_[gone].state.t < t) ++gone;
  if (gone == 0) return;
  EVPOSE_CHECK(gone <= fused_);
  // What the leaving states and the motion from them know of the first that stays. Its own measurement
  // remains a factor.
  linearise(gone + 1, false);
  if (!chain_.eliminate()) return;
  chain_.marginal(gone, &prior_information_, &prior_vector_);
  prior_at_ = nodes_[gone].state;
  nodes_.erase(nodes_.begin(), nodes_.begin() + static_cast<std::ptrdiff_t>(gone));
  fused_ -= gone;
}

}  // namespace evpose
