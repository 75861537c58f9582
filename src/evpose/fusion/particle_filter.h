// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <random>
#include <vector>

#include "evpose/fusion/back_end.h"
#include "evpose/fusion/preintegration.h"

namespace evpose {

/// Regularised particle filter over the whole state: particles are moved by the IMU with noise drawn from its
/// covariance, weighted by the measurement's likelihood, and drawn anew from a kernel density with the
/// particles' own mean and covariance when few of them carry the weight (Musso, Oudjane, Le Gland 2001; Liu
/// and West's shrinkage). The random numbers are the same in every run.
class ParticleFilter : public BackEnd {
 public:
  ParticleFilter(const Motion& motion, const ParticleConfig& config);

  void start(TimeNs t, const NavState& nav, const Eigen::Vector3d& angular_rate_body) override;
  void predict(const ImuSample& a, const ImuSample& b) override;
  void predict(TimeNs t) override;
  void update(const PoseInformation& measurement) override;
  /// Mean and covariance of the particles at the last update, carried on by the motion model.
  const FusionState& state() const override { return state_; }

 private:
  Vector15d normal();
  void spread(const FusionState& mean, const Matrix15d& covariance, double keep);
  void draw_by_weight();

  ParticleConfig config_;
  FusionState state_;
  std::vector<FusionState> particles_;
  std::vector<double> log_weights_;
  Preintegration since_;  ///< motion since the last update
  std::mt19937_64 random_;
};

}  // namespace evpose
