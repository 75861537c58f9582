// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <random>
#include <vector>

#include "evpose/fusion/back_end.h"

namespace evpose {

/// Gaussian particle filter on the pose (Kotecha and Djuric 2003): particles are drawn from the predicted
/// pose, weighted by the measurement's likelihood, and their moments are the new pose. Velocity and biases
/// follow by their regression on the pose (Rao-Blackwell). Particles that carry all 15 states from update to
/// update were tried first: with 500 of them their chance correlations taught the biases false certainty. The
/// random numbers are the same in every run.
class ParticleFilter : public BackEnd {
 public:
  ParticleFilter(const StatePropagator& propagator, int particles);

  using BackEnd::start;
  void start(const FusionState& first) override;
  void predict(const ImuSample& a, const ImuSample& b, ImuTrust trust) override {
    propagator().propagate(state_, a, b, trust);
  }
  void predict(TimeNs t) override { propagator().propagate(state_, t); }
  using BackEnd::update;
  void update(const PoseInformation& measurement, std::span<const ContourOffset> contours) override;
  const FusionState& state() const override { return state_; }

 private:
  /// Fills sample_ with normal numbers whose mean is exactly zero and whose covariance is exactly one.
  void draw();

  FusionState state_;
  Eigen::Matrix<double, 6, Eigen::Dynamic> sample_;  ///< one particle a column
  std::vector<double> weights_;
  std::mt19937_64 random_;
};

}  // namespace evpose
