// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/fusion/particle_filter.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "evpose/core/config.h"

namespace evpose {

using namespace error_state;

namespace {

/// L with L L^T = covariance; zero variances stay zero.
Matrix15d root_of(const Matrix15d& covariance) {
  const Vector15d sigma = covariance.diagonal().cwiseMax(1e-30).cwiseSqrt();
  Matrix15d correlation =
      sigma.cwiseInverse().asDiagonal() * covariance * sigma.cwiseInverse().asDiagonal();
  correlation.diagonal().array() += 1e-9;
  const Matrix15d L = correlation.llt().matrixL();
  return sigma.asDiagonal() * L;
}

}  // namespace

void describe(ConfigTable& table, ParticleConfig& c) {
  table.add("particles", c.particles, "", "number of particles", {20, 1e6});
  table.add("resample_below", c.resample_below, "", "share of effective particles below which all are drawn anew",
            {0, 1});
}

ParticleFilter::ParticleFilter(const Motion& motion, const ParticleConfig& config)
    : BackEnd(motion), config_(config), since_({0, 0, 0}, {0, 0, 0}) {}

Vector15d ParticleFilter::normal() {
  // Box and Muller's, since the standard library's own differs between implementations.
  constexpr double kUnit = 0x1p-53;
  Vector15d out;
  for (int i = 0; i < 16; i += 2) {
    const double u = (static_cast<double>(random_() >> 11) + 0.5) * kUnit;
    const double v = static_cast<double>(random_() >> 11) * kUnit;
    const double r = std::sqrt(-2 * std::log(u));
    out(i) = r * std::cos(2 * M_PI * v);
    if (i + 1 < 15) out(i + 1) = r * std::sin(2 * M_PI * v);
  }
  return out;
}

void ParticleFilter::start(TimeNs t, const NavState& nav, const Eigen::Vector3d& angular_rate_body) {
  random_.seed(1);
  state_ = motion().start(t, nav, angular_rate_body);
  particles_.assign(static_cast<std::size_t>(config_.particles), state_);
  spread(state_, state_.covariance, 0);
  since_ = Preintegration(state_.gyro_bias, state_.accel_bias);
}

void ParticleFilter::spread(const FusionState& mean, const Matrix15d& covariance, double keep) {
  const Matrix15d L = std::sqrt(1 - keep * keep) * root_of(covariance);
  for (FusionState& p : particles_) {
    const Vector15d own = keep * p.minus(mean) + L * normal();
    p = mean;
    p.add(own);
  }
  log_weights_.assign(particles_.size(), 0);
}

void ParticleFilter::draw_by_weight() {
  // Systematic: one random offset, then even steps through the sum of weights, which is 1.
  const double step = 1.0 / static_cast<double>(particles_.size());
  double at = step * static_cast<double>(random_() >> 11) * 0x1p-53;
  std::vector<FusionState> drawn;
  drawn.reserve(particles_.size());
  double sum = 0;
  for (std::size_t i = 0; i < particles_.size(); ++i) {
    sum += std::exp(log_weights_[i]);
    for (; at < sum && drawn.size() < particles_.size(); at += step) drawn.push_back(particles_[i]);
  }
  while (drawn.size() < particles_.size()) drawn.push_back(particles_.back());
  particles_ = std::move(drawn);
}

void ParticleFilter::predict(const ImuSample& a, const ImuSample& b) {
  motion().step(state_, a, b);
  since_.add(a, b, motion().noise());
}

void ParticleFilter::predict(TimeNs t) {
  since_.add({state_.t, {0, 0, 0}, {0, 0, 0}}, {t, {0, 0, 0}, {0, 0, 0}}, motion().noise());
  motion().step(state_, t);
}

void ParticleFilter::update(const PoseInformation& m) {
  const Matrix15d L = root_of(since_.covariance());
  double most = -1e300;
  for (std::size_t i = 0; i < particles_.size(); ++i) {
    FusionState& p = particles_[i];
    const Eigen::Matrix3d R = p.nav.T_map_body.rotation();
    p = since_.predict(p, motion().gravity_map());
    Vector15d noise = L * normal();
    noise.segment<3>(kP) = R * noise.segment<3>(kP);
    noise.segment<3>(kV) = R * noise.segment<3>(kV);
    p.add(noise);
    const Vector6d d = p.nav.T_map_body.minus(state_.nav.T_map_body);
    log_weights_[i] += m.vector.dot(d) - 0.5 * d.dot(m.information * d);
    most = std::max(most, log_weights_[i]);
  }
  double sum = 0;
  for (const double w : log_weights_) sum += std::exp(w - most);
  double squares = 0;
  Vector15d mean = Vector15d::Zero();
  Matrix15d moment = Matrix15d::Zero();
  for (std::size_t i = 0; i < particles_.size(); ++i) {
    log_weights_[i] -= most + std::log(sum);
    const double w = std::exp(log_weights_[i]);
    const Vector15d d = particles_[i].minus(state_);
    squares += w * w;
    mean += w * d;
    moment += w * d * d.transpose();
  }
  const Matrix15d covariance = moment - mean * mean.transpose();
  const double effective = 1 / squares;
  state_.add(mean);
  // Of a weighted sample; the mean is one of its own unknowns.
  state_.covariance = covariance / std::max(1e-3, 1 - squares);
  const auto count = static_cast<double>(particles_.size());
  if (effective < config_.resample_below * count) {
    draw_by_weight();
    const double width = std::pow(4 / (count * 17), 1.0 / 19);  // best kernel in 15 dimensions
    spread(state_, state_.covariance, std::sqrt(std::max(0.0, 1 - width * width)));
  }
  since_ = Preintegration(state_.gyro_bias, state_.accel_bias);
}

}  // namespace evpose
