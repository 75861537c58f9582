// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/fusion/window.h"

#include <Eigen/Cholesky>
#include <algorithm>

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
}

void Window::add(const Preintegration& motion, const FusionState& state, const PoseInformation& measurement,
                 const Pose& measured_at) {
  EVPOSE_CHECK(!nodes_.empty());
  nodes_.push_back({state, motion, measurement, measured_at});
}

void Window::linearise(std::size_t count, bool newest_measured) {
  chain_.resize(count);
  {
    const Vector15d d = nodes_[0].state.minus(prior_at_);
    Matrix15d J = Matrix15d::Identity();
    J.block<3, 3>(kPhi, kPhi) = so3::right_jacobian_inverse(d.segment<3>(kPhi));
    chain_.diagonal(0) += J.transpose() * prior_information_ * J;
    chain_.vector(0) += J.transpose() * (prior_vector_ - prior_information_ * d);
  }
  for (std::size_t i = 0; i < count; ++i) {
    const Node& node = nodes_[i];
    if (newest_measured || i + 1 < count) {
      const PoseInformation m = moved(node.measurement, node.measured_at, node.state.nav.T_map_body);
      chain_.diagonal(i).topLeftCorner<6, 6>() += m.information;
      chain_.vector(i).head<6>() += m.vector;
    }
    if (i == 0) continue;
    const Preintegration::Residual r = node.motion.residual(nodes_[i - 1].state, node.state, gravity_map_);
    const Matrix15d W = information_of(node.motion.covariance());
    const Matrix15d start_W = r.by_start.transpose() * W, end_W = r.by_end.transpose() * W;
    chain_.diagonal(i - 1) += start_W * r.by_start;
    chain_.diagonal(i) += end_W * r.by_end;
    chain_.below(i) += end_W * r.by_start;
    chain_.vector(i - 1) -= start_W * r.value;
    chain_.vector(i) -= end_W * r.value;
  }
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
  nodes_.back().state.covariance = chain_.newest_covariance();
  return true;
}

void Window::forget_before(TimeNs t) {
  std::size_t gone = 0;
  while (gone + 1 < nodes_.size() && nodes_[gone].state.t < t) ++gone;
  if (gone == 0) return;
  // What the leaving states and the motion from them know of the first that stays. Its own measurement
  // remains a factor.
  linearise(gone + 1, false);
  if (!chain_.eliminate()) return;
  chain_.marginal(gone, &prior_information_, &prior_vector_);
  prior_at_ = nodes_[gone].state;
  nodes_.erase(nodes_.begin(), nodes_.begin() + static_cast<std::ptrdiff_t>(gone));
}

}  // namespace evpose
