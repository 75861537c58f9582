// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/fusion/graph.h"

#include "evpose/core/config.h"
#include "evpose/fusion/ekf.h"

namespace evpose {

void describe(ConfigTable& table, WindowConfig& c) {
  table.add("length_s", c.length_s, "s", "states older than this are marginalised", {1e-3, 10});
  table.add("optimise_every", c.optimise_every, "", "updates from one joint optimisation to the next",
            {1, 1000});
  table.add("iterations", c.iterations, "", "Gauss-Newton steps of a joint optimisation", {1, 20});
}

Graph::Graph(const Motion& motion, const WindowConfig& config)
    : BackEnd(motion), config_(config), window_(motion.gravity_map()), since_({0, 0, 0}, {0, 0, 0}) {}

void Graph::start(const FusionState& first) {
  state_ = first;
  window_.start(state_);
  since_ = Preintegration(state_.gyro_bias, state_.accel_bias);
  waiting_ = 0;
}

void Graph::predict(const ImuSample& a, const ImuSample& b, bool suspect) {
  motion().step(state_, a, b, suspect);
  since_.add(a, b, motion().noise_at(0.5 * (a.gyro + b.gyro), 0.5 * (a.accel + b.accel), suspect));
}

void Graph::predict(TimeNs t) {
  since_.add({state_.t, {0, 0, 0}, {0, 0, 0}}, {t, {0, 0, 0}, {0, 0, 0}}, motion().noise());
  motion().step(state_, t);
}

void Graph::update(const PoseInformation& measurement) {
  const Pose predicted = state_.nav.T_map_body;
  correct(state_, measurement);
  if (since_.dt_s() == 0) return;  // a second measurement of one time: the newest state alone has it
  window_.add(since_, state_, measurement, predicted);
  if (++waiting_ >= config_.optimise_every && window_.optimise(config_.iterations)) {
    waiting_ = 0;
    const Eigen::Vector3d reading = state_.angular_rate + state_.gyro_bias;
    state_ = window_.newest();
    state_.angular_rate = reading - state_.gyro_bias;
    window_.forget_before(state_.t - from_seconds(config_.length_s));
  }
  since_ = Preintegration(state_.gyro_bias, state_.accel_bias);
}

}  // namespace evpose
