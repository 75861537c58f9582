// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/fusion/particle_filter.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace evpose {

ParticleFilter::ParticleFilter(const StatePropagator& propagator, int particles)
    : BackEnd(propagator), sample_(6, particles), weights_(static_cast<std::size_t>(particles)) {}

void ParticleFilter::start(const FusionState& first) {
  random_.seed(1);
  state_ = first;
}

void ParticleFilter::draw() {
  // Box and Muller's method, since the standard library's own differs between implementations.
  constexpr double kUnit = 0x1p-53;
  for (Eigen::Index j = 0; j < sample_.cols(); ++j)
    for (int i = 0; i < 6; i += 2) {
      const double u = (static_cast<double>(random_() >> 11) + 0.5) * kUnit;
      const double v = static_cast<double>(random_() >> 11) * kUnit;
      const double r = std::sqrt(-2 * std::log(u));
      sample_(i, j) = r * std::cos(2 * M_PI * v);
      sample_(i + 1, j) = r * std::sin(2 * M_PI * v);
    }
  sample_.colwise() -= sample_.rowwise().mean().eval();
  const Matrix6d covariance = sample_ * sample_.transpose() / static_cast<double>(sample_.cols());
  covariance.llt().matrixL().solveInPlace(sample_);
}

void ParticleFilter::update(const PoseInformation& m, std::span<const ContourOffset>) {
  draw();
  const Matrix6d P = state_.pose_covariance();
  const Vector6d sigma = P.diagonal().cwiseMax(1e-30).cwiseSqrt();
  Matrix6d correlation = sigma.cwiseInverse().asDiagonal() * P * sigma.cwiseInverse().asDiagonal();
  correlation.diagonal().array() += 1e-12;
  const Matrix6d root = correlation.llt().matrixL();
  sample_ = (sigma.asDiagonal() * root * sample_).eval();

  double most = -1e300;
  for (std::size_t i = 0; i < weights_.size(); ++i) {
    const Vector6d d = sample_.col(static_cast<Eigen::Index>(i));
    weights_[i] = m.vector.dot(d) - 0.5 * d.dot(m.information * d);
    most = std::max(most, weights_[i]);
  }
  double sum = 0;
  for (double& w : weights_) sum += w = std::exp(w - most);
  Vector6d mean = Vector6d::Zero();
  Matrix6d moment = Matrix6d::Zero();
  for (std::size_t i = 0; i < weights_.size(); ++i) {
    const Vector6d d = sample_.col(static_cast<Eigen::Index>(i));
    mean += weights_[i] / sum * d;
    moment += weights_[i] / sum * d * d.transpose();
  }
  const Matrix6d posterior = moment - mean * mean.transpose();

  // The rest of the state given the pose, as the prediction has it.
  const Eigen::Matrix<double, 15, 6> regression = P.ldlt().solve(state_.covariance.topRows<6>()).transpose();
  const Matrix15d covariance = state_.covariance - regression * (P - posterior) * regression.transpose();
  state_.covariance = 0.5 * (covariance + covariance.transpose());
  state_.add(regression * mean);
}

}  // namespace evpose
