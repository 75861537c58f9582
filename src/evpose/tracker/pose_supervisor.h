// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <span>
#include <string>

#include "evpose/fusion/back_end.h"
#include "evpose/registration/registration.h"
#include "evpose/tracker/health.h"
#include "evpose/tracker/held_covariance.h"
#include "evpose/tracker/pose_probability.h"
#include "evpose/tracker/pose_uncertainty.h"
#include "evpose/tracker/pose_verifier.h"
#include "evpose/tracker/relocalizer.h"
#include "evpose/tracker/verdict_history.h"

namespace evpose {

/// What one update has seen, for judgement.
struct UpdateEvidence {
  TimeNs t = 0;
  double span_s = 0;  ///< since the last update
  const RegistrationResult& registration;
  std::string refused;  ///< why the registration was not used; empty if it was
  std::string fault;    ///< what is wrong with the data, if anything
  PoseUncertainty::View view;
  bool frames_confirm = false;  ///< frames have shown the contours where the pose has them
};

/// Owns the decision whether the pose is known: searches it when it is not, verifies one that was found,
/// notices when it has gone astray, and names the tracker's health.
class PoseSupervisor {
 public:
  /// `map_may_be_wrong`: the map states errors of its contours.
  PoseSupervisor(const RelocalizationConfig& relocalization, const HealthConfig& health,
                 Relocalizer relocalizer, PoseVerifier verifier, bool map_may_be_wrong)
      : config_(relocalization),
        map_may_be_wrong_(map_may_be_wrong),
        health_config_(health),
        relocalizer_(std::move(relocalizer)),
        verifier_(std::move(verifier)),
        verdicts_(map_may_be_wrong),
        health_(health) {}

  /// Begins with the fusion's first state; searches for the pose if that is too unsure.
  void start(const FusionState& first, double sigma_px);

  /// The pose is being searched: there is none to measure at.
  bool searching() const { return relocalizer_.searching(); }
  /// The pose has to be searched, and is not: the start is too unsure, or the pose has been lost or refuted
  /// for long.
  bool needs_search() const {
    return !config_.on && !searching() &&
           ((start_is_unsure_ && !verdicts_.verified()) || should_be_searched_beside());
  }
  /// From now on a pose that gets lost is left to needs_search().
  void search_no_more() { config_.on = false; }
  /// One update's part of the search, or of watching a pose that was found. The state from which tracking
  /// begins anew, once it is found.
  std::optional<FusionState> search(const RelocalizerInput& input, const BackEnd& fusion);

  /// All events since the last update, which is `span_s` ago, and the contours where the pose has them;
  /// `elapsed_s`: since the last look. See PoseVerifier::add().
  void look(std::span<const FilteredEvent> events, std::span<const ContourSample> contours, double span_s,
            double elapsed_s, const BlockThinning& thinning) {
    verifier_.add(events, contours, span_s, elapsed_s, thinning);
  }

  /// The map's parts are those of another place from now on; see PoseVerifier. Not while searching.
  void rearrange(std::span<const std::uint32_t> segments_before, std::vector<bool> told) {
    verifier_.rearrange(segments_before, std::move(told));
    relocalizer_.forget_map();
  }

  /// Why the registration is not used; empty if it is.
  std::string refusal(TimeNs t, const RegistrationResult& registration, double innovation) const;

  /// Judges an update and acts on it: a search may begin or go on.
  Health judge(const UpdateEvidence& evidence, BackEnd& fusion, std::string* reason);
  /// Poses of the body that explain the events alike, likeliest first; none while at most one does.
  std::vector<Pose> candidates() const {
    return searching() ? relocalizer_.candidates() : std::vector<Pose>{};
  }
  /// That the pose is the right one, after judge().
  double probability() const { return searching() ? 0 : probability_.value(); }
  /// What the events since about a tenth of a second say of it.
  const PoseEvidence& look() const { return verifier_.evidence(); }
  /// At first the estimate is that of the start, not yet that of the contours.
  bool initialised() const {
    return health_.state() != Health::waiting && health_.state() != Health::initialising;
  }
  /// The pose's covariance, after judge(): what the fusion states, and more while events contradict the pose,
  /// while one that was found is not verified or was so lately, while its contours of one direction lie where
  /// no events are,
  /// and, in a map that states errors, where events that do not gather have made the pose seem better known.
  Matrix6d told_covariance(const FusionState& reported, const UpdateEvidence& evidence);

 private:
  bool verifying() const { return verify_until_ != 0; }
  bool verification_is_over(TimeNs t) const { return verifying() && t >= verify_until_; }
  bool found_pose_is_refuted(TimeNs t, const RegistrationResult& registration) const;
  bool pose_is_unconfirmed(TimeNs t, const RegistrationResult& registration) const;
  void take_verdict(double span_s, bool accepted);
  void weigh(const UpdateEvidence& e);
  bool is_hopeless() const;
  bool is_astray(const RegistrationResult& registration, Health health) const;
  bool is_astray_for_long() const;
  bool should_be_searched_beside() const;
  void resume_search(TimeNs t, BackEnd& fusion);
  void begin_search(TimeNs t, const BackEnd& fusion, const Matrix6d& covariance);

  RelocalizationConfig config_;
  bool map_may_be_wrong_;
  HealthConfig health_config_;
  Relocalizer relocalizer_;
  PoseVerifier verifier_;
  VerdictHistory verdicts_;
  PoseProbability probability_;
  HealthMonitor health_;
  HeldCovariance held_;
  FusionState before_search_;
  TimeNs verify_until_ = 0;  ///< a pose that was found is watched until then; 0: none
  double astray_s_ = 0;      ///< for how long the pose has been lost or not consistent with the map
  double doubted_s_ = 0;     ///< for how long in a row one that was given has been contradicted
  bool start_is_unsure_ = false;
  bool start_was_wrong_ = false;  ///< the pose is sought, or was found, near one that was given and refuted
  bool ever_believed_ = false;    ///< since the start
  bool believed_ = false;         ///< verified and probable enough, at some time since it was given or found
};

}  // namespace evpose
