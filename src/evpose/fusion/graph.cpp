// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/fusion/graph.h"

namespace evpose {
namespace {

/// Updates from one joint optimisation to the next. With the map the problem is linear to 1e-4 sigma: more
/// often brings nothing.
constexpr int kOptimiseEvery = 10;
/// Gauss-Newton steps of a joint optimisation; a third one moves nothing that could be measured.
constexpr int kIterations = 2;

}  // namespace

Graph::Graph(const StatePropagator& propagator, const FusionConfig& config)
    : BackEnd(propagator),
      window_s_(config.window_s),
      window_(propagator.gravity_map(),
              propagator.model() == MotionModel::imu
                  ? std::optional(MotionPrior(config.cv_accel_density, config.cv_angular_density))
                  : std::nullopt),
      since_({0, 0, 0}, {0, 0, 0}) {}

void Graph::start(const FusionState& first) {
  state_ = first;
  window_.start(first);
  since_ = Preintegration(first.gyro_bias, first.accel_bias);
  waiting_ = 0;
}

void Graph::predict(const ImuSample& a, const ImuSample& b, ImuTrust trust) {
  since_.add(a, b, propagator().noise_at(0.5 * (a.gyro + b.gyro), 0.5 * (a.accel + b.accel), trust));
  propagator().propagate(state_, a, b, trust);
}

void Graph::predict(TimeNs t) {
  // Constant velocity is an IMU that reads zero.
  since_.add({state_.t, {0, 0, 0}, {0, 0, 0}}, {t, {0, 0, 0}, {0, 0, 0}}, propagator().noise());
  propagator().propagate(state_, t);
}

void Graph::update(const PoseInformation& measurement, std::span<const ContourOffset>) {
  const Pose measured_at = state_.nav.T_map_body;
  bool fused = false;
  if (since_.dt_s() > 0) {
    window_.add(since_, state_, measurement, measured_at);
    fused = window_.fuse_newest();
  } else {  // a second measurement of one time
    window_.add_measurement(measurement, measured_at);
    fused = window_.optimise(1);
  }
  if (fused) take_newest();
  if (++waiting_ < kOptimiseEvery || !window_.optimise(kIterations)) return;
  waiting_ = 0;
  take_newest();
  window_.forget_before(state_.t - from_seconds(window_s_));
}

/// The window's newest state is the state.
void Graph::take_newest() {
  state_ = window_.newest();
  since_ = Preintegration(state_.gyro_bias, state_.accel_bias);
}

}  // namespace evpose
