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

Graph::Graph(const StatePropagator& propagator, double window_s)
    : BackEnd(propagator),
      window_s_(window_s),
      window_(propagator.gravity_map()),
      since_({0, 0, 0}, {0, 0, 0}) {}

void Graph::start(const FusionState& first) {
  filter_.reset_state(first);
  window_.start(first);
  since_ = Preintegration(first.gyro_bias, first.accel_bias);
  waiting_ = 0;
}

void Graph::predict(const ImuSample& a, const ImuSample& b, ImuTrust trust) {
  since_.add(a, b, propagator().noise_at(0.5 * (a.gyro + b.gyro), 0.5 * (a.accel + b.accel), trust));
  filter_.propagate(propagator(), a, b, trust);
}

void Graph::predict(TimeNs t) {
  // Constant velocity is an IMU that reads zero.
  since_.add({state().t, {0, 0, 0}, {0, 0, 0}}, {t, {0, 0, 0}, {0, 0, 0}}, propagator().noise());
  filter_.propagate(propagator(), t);
}

/// A measurement for the newest state, and for the window.
void Graph::update(const PoseInformation& measurement, std::span<const ContourOffset>) {
  const Pose measured_at = state().nav.T_map_body;
  measurement_.start(measurement);
  filter_.update(measurement_);
  ++waiting_;
  if (since_.dt_s() > 0) {  // of two measurements of one time, the newest state alone has the second
    window_.add(since_, state(), measurement, measured_at);
    since_ = Preintegration(state().gyro_bias, state().accel_bias);
  }
  if (waiting_ < kOptimiseEvery || !window_.optimise(kIterations)) return;
  waiting_ = 0;
  take_newest();
  window_.forget_before(state().t - from_seconds(window_s_));
}

/// The window's newest state is the state.
void Graph::take_newest() {
  const Eigen::Vector3d reading = state().angular_rate + state().gyro_bias;
  FusionState newest = window_.newest();
  newest.angular_rate = reading - newest.gyro_bias;
  filter_.reset_state(newest);
  since_ = Preintegration(newest.gyro_bias, newest.accel_bias);
}

}  // namespace evpose
