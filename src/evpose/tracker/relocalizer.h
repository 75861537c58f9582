// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "evpose/imu/strapdown.h"
#include "evpose/map/visible_set.h"
#include "evpose/registration/pose_search.h"
#include "evpose/relocalization/attitude_finder.h"
#include "evpose/relocalization/wide_search.h"
#include "evpose/tracker/event_slice.h"
#include "evpose/tracker/hypothesis_refiner.h"
#include "evpose/tracker/pose_hypothesis.h"

namespace evpose {

class ConfigTable;

struct RelocalizationConfig {
  bool on = true;
  double position_sigma_m = 0.1;      ///< of the search region around the last pose after a loss, per axis
  double rotation_sigma_rad = 0.035;  ///< likewise
};
void describe(ConfigTable& table, RelocalizationConfig& config);

/// One update: the events since the last one and how the body has moved since.
struct RelocalizerInput {
  TimeNs t;
  std::uint32_t now_us;  ///< t on the events' clock
  std::span<const FilteredEvent> events;
  const ImuIncrement& motion;
  const Eigen::Vector3d& angular_rate;  ///< rad/s, body
  const Pose& T_body_cam;
};

/// Finds the pose from a poor guess. In a first slice of events many poses are compared (search_pose(), or
/// WideSearch where metres and headings are unknown). The best become hypotheses that are tracked over the
/// next slices, each refined together with its velocity (HypothesisRefiner). The pose is accepted whose
/// events concentrate at the contours rather than lie evenly over the gate, and clearly more so than those of
/// any other. In a map that states errors, searches in further slices compete with the first.
class Relocalizer {
 public:
  /// A start pose known better than this, as image motion, needs no search: the tracker's gate reaches it.
  static constexpr double kSearchAboveSigma_px = 2.5;
  /// A pose found is verified for so long before it is called tracking: a wrong one shows by then.
  static constexpr double kVerify_s = 0.06;
  /// Gate concentration below which a pose found is refuted, and with which one without a rival is accepted.
  static constexpr double kLowConcentration = 0.3;
  /// Standard deviations of a state found, per axis.
  static constexpr double kFoundPositionSigma_m = 3e-3, kFoundRotationSigma_rad = 2e-3,
                          kFoundVelocitySigma_m_s = 0.3;

  explicit Relocalizer(const RelocalizerScene& scene);

  /// Begins a search around `state`; covariance of its pose as Pose::plus. `start_was_wrong`: the covariance
  /// of a pose that was given did not hold, so that the true one may be metres away; where places repeat,
  /// poses that far off compete.
  void begin_search(TimeNs t, const NavState& state, const Matrix6d& covariance,
                    bool start_was_wrong = false);
  bool searching() const { return searching_; }
  /// The pose is not where it was searched, at any width of the search.
  bool has_tried_all() const;
  /// Poses of the body that explain the events so alike that their further motion has to decide, likeliest
  /// first; none while at most one is in question.
  std::vector<Pose> candidates() const;
  /// The pose found was wrong: searches again around where the search began.
  void restart_search(TimeNs t);
  /// The map's index is that of another part from now on. Not while searching.
  void forget_map() {
    if (workspace_) workspace_ = std::make_unique<Workspace>(scene_, motion_);
  }
  /// How the body has moved since the last call of this or process(), while a pose found is verified.
  void add_motion(const ImuIncrement& motion) { since_slice_ = joined(since_slice_, motion); }

  struct Found {
    NavState nav;
    Eigen::Vector3d angular_rate;  ///< rad/s, body
  };
  /// The state at input.t once it is found, which ends the search.
  std::optional<Found> process(const RelocalizerInput& input);

 private:
  /// What a search needs and a run without one does not pay for.
  struct Workspace {
    explicit Workspace(const RelocalizerScene& scene, const HypothesisMotion& motion);
    EdgeField field;
    VisibleSet visible;  ///< points for the edges
    AttitudeFinder attitudes;
    PlaceCache places;               ///< where the scene has none
    std::optional<WideSearch> wide;  ///< once a prior has asked for it
    bool widely = false;             ///< this search is one by `wide`
    HypothesisRefiner refiner;
    std::vector<FilteredEvent> compensated;  ///< the slice's events, without rotation
    std::vector<SearchPoint> points;
  };
  double pause_s() const;
  double gap_s() const;
  bool explains_enough(const PoseHypothesis& h) const;
  void process_slice(const RelocalizerInput& input);
  void propagate_prior();
  SearchView view_from(const Pose& T_map_body, const Pose& T_body_cam);
  bool slice_is_complete(TimeNs t) const;
  void search_around_prior(const Pose& T_body_cam, double age_s);
  /// One search is not enough to believe a pose: searches in further slices compete.
  bool wants_more_searches() const { return map_may_be_wrong_ && !workspace_->widely; }
  bool searches_compete() const;
  void search_again(const Pose& T_body_cam, double age_s);
  void go_on_with_velocity_found();
  void add_aliases(const Pose& T_body_cam, double age_s);
  void rank_hypotheses();
  void keep_hopeful();
  void search_widely(const Pose& T_body_cam, double age_s);
  WidePrior wide_prior() const;
  void add_hypothesis(const PoseGuess& guess, const Eigen::Vector3d& velocity, const Pose& T_body_cam,
                      double age_s);
  void update_hypotheses(const Pose& T_body_cam, double age_s);
  PoseHypothesis updated(const PoseHypothesis& predicted, bool refined, const SearchView& view, double age_s);
  PoseHypothesis corrected_by_edges(const PoseHypothesis& predicted, const SearchView& view,
                                    double age_s) const;
  bool is_accepted(const PoseHypothesis& best) const;
  std::optional<Found> accept_best();

  RelocalizerScene scene_;
  HypothesisMotion motion_;
  std::unique_ptr<Workspace> workspace_;

  bool searching_ = false;
  NavState prior_;  ///< at the last slice
  Matrix6d prior_covariance_ = Matrix6d::Zero();
  std::vector<PoseHypothesis> hypotheses_;  ///< best first
  EventSlice slice_;
  TimeNs last_slice_ = 0;
  ImuIncrement since_slice_;  ///< motion since the last slice, or since begin_search()
  double elapsed_s_ = 0;      ///< from begin_search() to the last slice
  Eigen::Vector3d angular_rate_ = Eigen::Vector3d::Zero();
  double velocity_sigma_m_s_ = 0;  ///< of the prior, with which it may have gone off
  int slices_ = 0, searches_ = 0;
  int draws_ = 0;                 ///< of poses around the prior, since begin_search()
  bool start_was_wrong_ = false;  ///< poses far outside of the prior compete
  bool map_may_be_wrong_;         ///< it states errors of its contours
};

}  // namespace evpose
