// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/pose_supervisor.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace evpose {
namespace {

constexpr double kPatience_s = 0.5;  // lost, or with a pose that is not consistent with the map: then search
constexpr double kPatienceWithGiven_s = 1;  // with one that was given, in a map that states errors
constexpr const char* kContradiction =
    "not in this map, or far from the pose: contours lie where no events are";
constexpr const char* kImprobable = "pose in doubt: contours and events agree no better than at wrong poses";
constexpr const char* kOneDirection =
    "not in this map, or far from the pose: contours of one direction lie where no events are";

/// Empty without any.
std::string words_of(const std::vector<Pose>& candidates) {
  const auto cm = [](double m) { return std::round(100 * m) / 100; };
  std::string out;
  for (const Pose& T : candidates) {
    const Eigen::Vector3d ahead = T.q * Eigen::Vector3d::UnitX();
    const auto heading_deg = std::lround(std::atan2(ahead.y(), ahead.x()) * 180 / std::numbers::pi);
    out += text(out.empty() ? "" : ", ", "(", cm(T.p.x()), ", ", cm(T.p.y()), ", ", cm(T.p.z()),
                ") m heading ", heading_deg, " deg");
  }
  return out.empty() ? out : text(candidates.size(), " poses explain the events alike: ", out);
}

}  // namespace

void PoseSupervisor::start(const FusionState& first, double sigma_px) {
  health_.start(first.t);
  probability_.given();
  before_search_ = first;
  start_is_unsure_ = sigma_px > Relocalizer::kSearchAboveSigma_px;
  if (config_.on && start_is_unsure_) relocalizer_.begin_search(first.t, first.nav, first.pose_covariance());
}

std::optional<FusionState> PoseSupervisor::search(const RelocalizerInput& input, const BackEnd& fusion) {
  if (!searching()) {
    if (verifying()) relocalizer_.add_motion(input.motion);
    return {};
  }
  const FusionState& old = fusion.state();
  const auto found = relocalizer_.process(input);
  if (!found) return {};
  FusionState state = fusion.propagator().initial_state(old.t, found->nav, found->angular_rate);
  state.gyro_bias = old.gyro_bias;
  state.accel_bias = old.accel_bias;
  if (fusion.propagator().model() == MotionModel::constant_velocity) state.gyro_bias = -found->angular_rate;
  const auto set_sigma = [&state](int at, double sigma) {
    state.covariance.diagonal().segment<3>(at).setConstant(sigma * sigma);
  };
  set_sigma(error_state::kP, Relocalizer::kFoundPositionSigma_m);
  set_sigma(error_state::kPhi, Relocalizer::kFoundRotationSigma_rad);
  set_sigma(error_state::kV, Relocalizer::kFoundVelocitySigma_m_s);
  verify_until_ = input.t + from_seconds(Relocalizer::kVerify_s);
  verifier_.restart();
  believed_ = false;
  probability_.found();
  verdicts_.found(start_was_wrong_);
  return state;
}

void PoseSupervisor::take_verdict(double span_s, bool accepted) {
  const PoseVerdict verdict = verifying() ? verifier_.verdict_of_found() : verifier_.verdict();
  verdicts_.add({verdict, span_s, verifying(), accepted, probability_.is_believed()});
}

void PoseSupervisor::weigh(const UpdateEvidence& e) {
  if (searching()) return;
  if (e.frames_confirm)
    probability_.confirm();
  else if (e.refused.empty())
    probability_.add(look(), e.registration.gate_concentration, e.span_s);
  believed_ |= verdicts_.verified() && probability_.is_believed();
  ever_believed_ |= believed_;
}

bool PoseSupervisor::is_hopeless() const {
  return searching() ? relocalizer_.has_tried_all() : !config_.on && verdicts_.is_hopeless();
}

Matrix6d PoseSupervisor::told_covariance(const FusionState& reported, const UpdateEvidence& e) {
  const Matrix6d stated = reported.pose_covariance();
  const Matrix6d doubt = verdicts_.doubt(verifying());
  if (searching()) held_.restart(VerdictHistory::kFoundPosition_m, VerdictHistory::kFoundRotation_rad);
  if (!map_may_be_wrong_ || !initialised()) return stated + doubt;
  return doubt + held_.update(stated, reported.nav.T_map_body.q, e.registration.gate_concentration, e.span_s);
}

/// A pose that was found is believed once its events have concentrated at the contours for a while, and are
/// clearly more there than beside them.
bool PoseSupervisor::found_pose_is_refuted(TimeNs t, const RegistrationResult& r) const {
  return verification_is_over(t) &&
         (r.gate_concentration < Relocalizer::kLowConcentration || verdicts_.is_contradicted());
}

bool PoseSupervisor::pose_is_unconfirmed(TimeNs t, const RegistrationResult& r) const {
  return searching() || t < verify_until_ || found_pose_is_refuted(t, r);
}

/// Contours of a map that may be wrong can lie where no events are at the right pose, too. A search would
/// then leave it for one that only looks better: one that was given is left where events do not gather at it,
/// one that was verified not even then, since a change of the light hides where they gather.
bool PoseSupervisor::is_astray(const RegistrationResult& r, Health health) const {
  const bool refuted = map_may_be_wrong_
                           ? !r.consistent && !verdicts_.verified()
                           : verdicts_.is_contradicted() || (!r.consistent && !verdicts_.verified());
  return refuted || (health == Health::lost && !verifying());
}

bool PoseSupervisor::is_astray_for_long() const {
  return astray_s_ > kPatience_s || doubted_s_ > kPatienceWithGiven_s;
}

bool PoseSupervisor::should_be_searched_beside() const {
  return is_astray_for_long() || doubted_s_ > kPatience_s;
}

std::string PoseSupervisor::refusal(TimeNs t, const RegistrationResult& r, double innovation) const {
  if (searching() || found_pose_is_refuted(t, r)) return "searching for the pose";
  if (r.points == 0) return "no map point in view";
  if (r.inliers < kLeastInliers)
    return text("only ", r.inliers, " of ", r.points, " map points have events near by");
  if (!(innovation <= health_config_.innovation_gate)) return "registration contradicts the prediction";
  return "";
}

void PoseSupervisor::resume_search(TimeNs t, BackEnd& fusion) {
  // What a wrong pose has taught goes with it.
  FusionState state = fusion.state();
  state.gyro_bias = before_search_.gyro_bias;
  state.accel_bias = before_search_.accel_bias;
  fusion.start(state);
  relocalizer_.restart_search(t);
  verifier_.restart();
  verdicts_.contradict();
}

void PoseSupervisor::begin_search(TimeNs t, const BackEnd& fusion, const Matrix6d& covariance) {
  Matrix6d around = covariance;
  around.diagonal().head<3>().array() += std::pow(config_.position_sigma_m, 2);
  around.diagonal().tail<3>().array() += std::pow(config_.rotation_sigma_rad, 2);
  start_was_wrong_ = !ever_believed_;
  before_search_ = fusion.state();
  relocalizer_.begin_search(t, fusion.state().nav, around, start_was_wrong_);
  verifier_.restart();
  astray_s_ = doubted_s_ = 0;
}

Health PoseSupervisor::judge(const UpdateEvidence& e, BackEnd& fusion, std::string* reason) {
  const FusionState state = fusion.state();
  // Errors that all contours share move pose and contours together: they belong to the covariance that is
  // told, not to how far a contour may lie from where it is looked for.
  const PoseUncertainty uncertainty(state, e.view);
  take_verdict(e.span_s, e.refused.empty());
  if (e.frames_confirm && !searching()) verdicts_.verify();
  weigh(e);
  const bool refuted = found_pose_is_refuted(e.t, e.registration);
  Evidence evidence;
  evidence.t = e.t;
  evidence.accepted = e.refused.empty();
  evidence.refused = e.refused;
  evidence.searching = pose_is_unconfirmed(e.t, e.registration);
  evidence.ambiguous = words_of(candidates());
  // Without an IMU nothing but the image tells rotation from sideways motion: it is enough that it holds.
  const bool by_image_alone = fusion.propagator().model() == MotionModel::constant_velocity;
  evidence.sigma_px = by_image_alone ? uncertainty.image_px() : uncertainty.separate_px();
  if (evidence.sigma_px > health_config_.degraded_sigma_px)
    evidence.weakest = uncertainty.weakest_direction();
  evidence.fault = e.fault;
  evidence.verified = believed_;
  evidence.hopeless = is_hopeless();
  if (believed_ && !probability_.is_believed()) evidence.contradicted = kImprobable;
  if (verdicts_.is_contested()) evidence.contradicted = kOneDirection;
  if (verdicts_.is_contradicted() || evidence.hopeless) evidence.contradicted = kContradiction;
  const Health health = health_.judge(evidence, reason);
  astray_s_ = !e.frames_confirm && is_astray(e.registration, health) ? astray_s_ + e.span_s : 0;
  doubted_s_ = !e.frames_confirm && map_may_be_wrong_ && !verdicts_.verified() && verdicts_.is_contradicted()
                   ? doubted_s_ + e.span_s
                   : 0;
  if (verification_is_over(e.t) && (verdicts_.verified() || refuted)) verify_until_ = 0;
  if (refuted) resume_search(e.t, fusion);
  if (config_.on && !searching() && is_astray_for_long()) begin_search(e.t, fusion, state.pose_covariance());
  return health;
}

}  // namespace evpose
