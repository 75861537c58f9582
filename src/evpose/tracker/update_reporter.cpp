// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/update_reporter.h"

#include <utility>

namespace evpose {

void UpdateReporter::begin(double events_s) {
  update_ = {};
  update_.times.choose_s = prepared_s_;
  update_.times.events_s = events_s;
  if (clock_) stage_began_s_ = clock_();
}

void UpdateReporter::end_stage(double StageTimes::*stage) {
  if (!clock_) return;
  const double now_s = clock_();
  update_.times.*stage = now_s - std::exchange(stage_began_s_, now_s);
}

void UpdateReporter::add_registration(const RegistrationResult& r, double innovation, bool accepted,
                                      double share) {
  update_.share = share;
  update_.innovation = innovation;
  update_.accepted = accepted;
  update_.points = r.points;
  update_.points_matched = r.inliers;
  update_.gate_concentration = r.gate_concentration;
  update_.residual = r.residual;
  update_.events_matched = r.events;
  update_.wrong_polarity = r.wrong_polarity;
  update_.other_motion = r.other_motion;
}

void UpdateReporter::add_judgement(Health health, std::string reason, std::vector<Pose> candidates,
                                   const Matrix6d& covariance) {
  update_.health = health;
  update_.reason = std::move(reason);
  update_.candidates = std::move(candidates);
  update_.covariance = covariance;
}

void UpdateReporter::add_probability(double probability, const PoseEvidence& look) {
  update_.probability = probability;
  update_.look = look;
}

Update UpdateReporter::finish(const FusionState& state, const EventPreprocessor::Counts& counts) {
  update_.t = state.t;
  update_.T_map_body = state.nav.T_map_body;
  update_.velocity = state.nav.velocity;
  update_.gyro_bias = state.gyro_bias;
  update_.accel_bias = state.accel_bias;
  update_.angular_rate = state.angular_rate;
  update_.velocity_covariance = state.covariance.block<3, 3>(error_state::kV, error_state::kV);
  update_.events_read = static_cast<std::int32_t>(counts.read - counted_.read);
  update_.events_shed = static_cast<std::int32_t>(counts.shed - counted_.shed);
  update_.events_kept = static_cast<std::int32_t>(counts.kept - counted_.kept);
  counted_ = counts;
  end_stage(&StageTimes::fuse_s);
  return update_;
}

}  // namespace evpose
