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
  table.add("background", c.background, "optimise beside the updates; the result does not depend on timing");
  table.add("delay", c.delay, "", "updates after which a result of the background is used", {1, 1000});
}

Graph::Graph(const StatePropagator& propagator, const WindowConfig& config, Coupling coupling)
    : BackEnd(propagator),
      config_(config),
      coupling_(coupling),
      window_(propagator.gravity_map()),
      since_({0, 0, 0}, {0, 0, 0}) {}

void Graph::start(const FusionState& first) {
  job_ = {};
  steps_.clear();
  since_job_.clear();
  state_ = first;
  window_.start(state_);
  since_ = Preintegration(state_.gyro_bias, state_.accel_bias);
  waiting_ = 0;
}

void Graph::predict(const ImuSample& a, const ImuSample& b, ImuTrust trust) {
  carry({a, b, trust});
  if (job_.valid()) steps_.push_back({a, b, trust});
}

void Graph::predict(TimeNs t) {
  const Step step{{state_.t, {0, 0, 0}, {0, 0, 0}}, {t, {0, 0, 0}, {0, 0, 0}}};
  carry(step);
  if (job_.valid()) steps_.push_back(step);
}

void Graph::carry(const Step& s) {
  if (propagator().model() == MotionModel::constant_velocity) {
    since_.add(s.a, s.b, propagator().noise());
    return propagator().propagate(state_, s.b.t);
  }
  since_.add(s.a, s.b,
             propagator().noise_at(0.5 * (s.a.gyro + s.b.gyro), 0.5 * (s.a.accel + s.b.accel), s.trust));
  propagator().propagate(state_, s.a, s.b, s.trust);
}

/// A measurement for the newest state, and for the window.
void Graph::fuse(const PoseInformation& measurement, const Pose& measured_at,
                 std::span<const ContourOffset> contours) {
  correct(state_, moved(measurement, measured_at, state_.nav.T_map_body));
  if (since_.dt_s() == 0) return;  // a second measurement of one time: the newest state alone has it
  window_.add(since_, state_, measurement, measured_at, contours);
  since_ = Preintegration(state_.gyro_bias, state_.accel_bias);
}

void Graph::update(const PoseInformation& measurement, std::span<const ContourOffset> contours) {
  const Pose predicted = state_.nav.T_map_body;
  fuse(measurement, predicted, contours);
  ++waiting_;
  if (job_.valid()) {
    since_job_.push_back({std::move(steps_), measurement, predicted, {contours.begin(), contours.end()}});
    steps_.clear();
    if (static_cast<int>(since_job_.size()) >= config_.delay) end_background();
  }
  if (waiting_ < config_.optimise_every || job_.valid()) return;
  if (config_.background) return begin_background();
  if (!window_.optimise(config_.iterations)) return;
  waiting_ = 0;
  take_newest();
  window_.forget_before(state_.t - from_seconds(config_.length_s));
}

/// The window's newest state is the state.
void Graph::take_newest() {
  const Eigen::Vector3d reading = state_.angular_rate + state_.gyro_bias;
  state_ = window_.newest();
  state_.angular_rate = reading - state_.gyro_bias;
  since_ = Preintegration(state_.gyro_bias, state_.accel_bias);
}

void Graph::begin_background() {
  waiting_ = 0;
  const TimeNs keep_from = state_.t - from_seconds(config_.length_s);
  const int iterations = config_.iterations;
  job_ = std::async(std::launch::async,
                    [window = window_, keep_from, iterations]() mutable -> std::optional<Window> {
                      if (!window.optimise(iterations)) return std::nullopt;
                      window.forget_before(keep_from);
                      return window;
                    });
}

void Graph::end_background() {
  std::optional<Window> result = job_.get();
  const std::vector<Done> done = std::move(since_job_);
  since_job_.clear();
  if (!result) return;
  window_ = std::move(*result);
  take_newest();
  for (const Done& update : done) {
    for (const Step& step : update.steps) carry(step);
    fuse(update.measurement, update.measured_at, update.contours);
  }
}

}  // namespace evpose
