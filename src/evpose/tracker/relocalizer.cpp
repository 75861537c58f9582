// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/relocalizer.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

#include "evpose/core/config.h"
#include "evpose/core/log.h"
#include "evpose/tracker/hypothesis_choice.h"
#include "evpose/tracker/tracker_parts.h"

namespace evpose {
namespace {

// Time between slices, and before a search is repeated.
constexpr double kGap_s = 0.004;           // so that slices differ
constexpr double kAmbiguousGap_s = 0.03;   // their velocities are known by then
constexpr double kPausePerSearch_s = 0.1;  // a search costs seconds of processor time
constexpr double kLongestPause_s = 2;

// Size of the search region, from search to search.
constexpr int kSearchesOfFirstWidth = 3;  // other slices may show what the first did not
constexpr int kMostWidenings = 2;
constexpr double kWidening = 1.5;  // of each standard deviation

// Points that are compared with edges: some hundred tell poses apart.
constexpr double kPointStride_px = 8, kPointMargin_px = 40;
constexpr int kPoints = 700;

// Hypotheses.
constexpr std::size_t kRefined = 6;    // best ones, by single events: these take most of the time
constexpr int kSlicesWithEdges = 2;    // then only those that were refined go on, by single events alone
constexpr double kHopefulShare = 0.5;  // of the best one's support, with which one goes on
constexpr double kNewestWeight = 0.4;  // of the newest slice in the means
constexpr double kLeastStep_s = 1e-3, kFirstRateGain = 1, kRateGain = 0.5;  // without a gyroscope

// Acceptance; see is_clear().
constexpr int kLeastSlices = 4;            // before a pose is accepted
constexpr int kMostSlices = 10;            // then the search starts anew
constexpr int kRivalSlices = 12;           // so soon one may not have come to its place; in a true map
constexpr double kLeastExplained = 0.06;   // of all events, beyond an even spread; wide searches
constexpr int kLastCompeting = 5;          // slice in which searches compete, from the third on
constexpr std::size_t kMostTogether = 10;  // hypotheses, then

VisibleSetConfig points_to_search(VisibleSetConfig config) {
  config.stride_px = kPointStride_px;
  config.margin_px = kPointMargin_px;
  config.budget = kPoints;
  config.refresh_px = 0;  // chosen anew in each slice
  return config;
}

}  // namespace

void describe(ConfigTable& table, RelocalizationConfig& c) {
  table.add("on", c.on, "search the pose when it starts or becomes unsure");
  table.add("position_sigma_m", c.position_sigma_m, "m", "of the search region after a loss", {1e-3, 10});
  table.add("rotation_sigma_rad", c.rotation_sigma_rad, "rad", "of the search region after a loss",
            {1e-4, 1});
}

Relocalizer::Workspace::Workspace(const RelocalizerScene& scene, const HypothesisMotion& motion)
    : field(scene.camera.size()),
      visible(scene.index, scene.camera, points_to_search(scene.visible)),
      attitudes(scene.index.map(), scene.camera),
      refiner(scene, motion) {}

Relocalizer::Relocalizer(const RelocalizerScene& scene)
    : scene_(scene),
      motion_(scene.gravity_map),
      slice_(scene.camera.size().width),
      map_may_be_wrong_(states_errors(scene.index.map())) {}

void Relocalizer::begin_search(TimeNs t, const NavState& state, const Matrix6d& covariance,
                               bool start_was_wrong) {
  if (!workspace_) workspace_ = std::make_unique<Workspace>(scene_, motion_);
  prior_ = state;
  prior_covariance_ = covariance;
  start_was_wrong_ = start_was_wrong;
  last_slice_ = 0;
  since_slice_ = {};
  elapsed_s_ = 0;
  velocity_sigma_m_s_ = kUnknownVelocitySigma_m_s;
  restart_search(t);
  searches_ = draws_ = 0;
  workspace_->widely = motion_.has_imu() && WideSearch::suits(covariance);
  if (!workspace_->widely) return;
  if (!workspace_->wide)
    workspace_->wide.emplace(scene_.index, scene_.camera, scene_.visible,
                             scene_.places != nullptr ? *scene_.places : workspace_->places);
  workspace_->wide->prepare(wide_prior());
}

void Relocalizer::restart_search(TimeNs t) {
  searching_ = true;
  hypotheses_.clear();
  slice_.restart(t);
  workspace_->refiner.clear_events();
  slices_ = 0;
  ++searches_;
}

bool Relocalizer::has_tried_all() const { return searches_ > kSearchesOfFirstWidth + kMostWidenings; }

/// Before a search: the first ones follow at once, later ones ever more slowly.
double Relocalizer::pause_s() const {
  return searches_ <= kSearchesOfFirstWidth
             ? kGap_s
             : std::min(kLongestPause_s, kPausePerSearch_s * (searches_ - kSearchesOfFirstWidth));
}

double Relocalizer::gap_s() const {
  if (slices_ == 0) return pause_s();
  return slices_ >= kMostSlices ? kAmbiguousGap_s : kGap_s;
}

std::optional<Relocalizer::Found> Relocalizer::process(const RelocalizerInput& input) {
  since_slice_ = joined(since_slice_, input.motion);
  angular_rate_ = input.angular_rate;
  workspace_->refiner.add_events(input.events, input.now_us, input.motion, input.angular_rate);
  if (to_seconds(input.t - last_slice_) < gap_s()) {
    slice_.restart(input.t);
    return {};
  }
  slice_.add(input.events);
  if (!slice_is_complete(input.t)) return {};
  if (slice_.sparse()) {
    slice_.restart(input.t);
    return {};
  }
  process_slice(input);
  slice_.restart(input.t);
  last_slice_ = input.t;
  return accept_best();
}

/// A wide search wants more of the image's lines than a narrow one, whose contours have to be sharp.
bool Relocalizer::slice_is_complete(TimeNs t) const {
  return workspace_->widely && slices_ == 0 ? slice_.complete_with_faint_edges(t) : slice_.complete(t);
}

void Relocalizer::process_slice(const RelocalizerInput& input) {
  const double age_s = slice_.mean_age_s(input.now_us);
  const Eigen::Vector3d rate_cam = motion_.has_imu()
                                       ? Eigen::Vector3d(input.T_body_cam.q.conjugate() * angular_rate_)
                                       : Eigen::Vector3d::Zero();
  if (slices_ < kSlicesWithEdges || searches_compete()) {
    compensate_rotation(slice_.events(), scene_.camera, {rate_cam, input.now_us, age_s},
                        workspace_->compensated);
    workspace_->field.build(workspace_->compensated);
  }
  propagate_prior();
  if (slices_ == 0) hypotheses_.clear();
  if (slices_ == 0 && workspace_->widely)
    search_widely(input.T_body_cam, age_s);
  else if (slices_ == 0)
    search_around_prior(input.T_body_cam, age_s);
  else
    update_hypotheses(input.T_body_cam, age_s);
  if (start_was_wrong_ && !workspace_->widely && slices_ == kSlicesWithEdges - 1)
    add_aliases(input.T_body_cam, age_s);
  if (searches_compete()) search_again(input.T_body_cam, age_s);
  since_slice_ = {};
  ++slices_;
}

void Relocalizer::propagate_prior() {
  PoseHypothesis prior{prior_};
  motion_.propagate(prior, since_slice_, false);
  // With a wrong attitude, gravity would accelerate it.
  if (workspace_->widely)
    prior_.T_map_body.q = prior.nav.T_map_body.q;
  else
    prior_ = prior.nav;
  elapsed_s_ += since_slice_.dt_s;
}

/// The slice's edges, and the contours in view from this pose.
SearchView Relocalizer::view_from(const Pose& T_map_body, const Pose& T_body_cam) {
  const ContourMap& map = scene_.index.map();
  workspace_->points.clear();
  for (const std::uint32_t i : workspace_->visible.choose(T_map_body * T_body_cam))
    workspace_->points.push_back({map.position(i), map.points[i].tangent.cast<double>()});
  return {workspace_->field, scene_.camera, T_body_cam, workspace_->points};
}

void Relocalizer::search_around_prior(const Pose& T_body_cam, double age_s) {
  const double widening =
      std::pow(kWidening, std::clamp(searches_ - kSearchesOfFirstWidth, 0, kMostWidenings));
  PosePrior prior{prior_.T_map_body, widening * widening * prior_covariance_};
  prior.covariance.topLeftCorner<3, 3>().diagonal().array() += std::pow(velocity_sigma_m_s_ * elapsed_s_, 2);
  const SearchView view = view_from(prior_.T_map_body, T_body_cam);
  if (view.points.empty()) return;
  const Eigen::Matrix3d of_attitude = prior.covariance.bottomRightCorner<3, 3>();
  if (AttitudeFinder::suits(of_attitude)) {
    prior.attitudes =
        workspace_->attitudes.find(workspace_->compensated, T_body_cam.q, prior_.T_map_body.q, of_attitude);
    prior.attitude_sigma_rad = AttitudeFinder::kSigma_rad;
  }
  for (const PoseGuess& guess : search_pose(view, prior, static_cast<unsigned>(++draws_)))
    add_hypothesis(guess, prior_.velocity, T_body_cam, age_s);
}

bool Relocalizer::searches_compete() const {
  return wants_more_searches() && slices_ >= kSlicesWithEdges && slices_ < kLastCompeting;
}

WidePrior Relocalizer::wide_prior() const {
  WidePrior out{prior_.T_map_body, prior_covariance_,
                since_slice_.dt_s > 0 ? Eigen::Vector3d(since_slice_.dq.conjugate() * since_slice_.dv)
                                      : Eigen::Vector3d::UnitZ()};
  out.covariance.topLeftCorner<3, 3>().diagonal().array() +=
      std::pow(kUnknownVelocitySigma_m_s * elapsed_s_, 2);
  return out;
}

void Relocalizer::search_widely(const Pose& T_body_cam, double age_s) {
  for (const PoseGuess& guess :
       workspace_->wide->find(workspace_->compensated, workspace_->field, T_body_cam, wide_prior()))
    add_hypothesis(guess, Eigen::Vector3d::Zero(), T_body_cam, age_s);
}

void Relocalizer::add_hypothesis(const PoseGuess& guess, const Eigen::Vector3d& velocity,
                                 const Pose& T_body_cam, double age_s) {
  // The slice shows where the body was age_s ago.
  PoseHypothesis h{{carried_on(guess.T_map_body, velocity, angular_rate_, age_s), velocity}};
  if (hypotheses_.size() < kRefined)
    workspace_->refiner.refine(h, T_body_cam, std::min(slices_, kSlicesWithEdges));
  h.mean_concentration = h.concentration;
  h.mean_support = h.support;
  h.position_variance = std::pow(kEdgePositionSigma_m, 2);
  h.rotation_variance = std::pow(kEdgeRotationSigma_rad, 2);
  h.velocity_variance = kUnknownVelocitySigma_m_s * kUnknownVelocitySigma_m_s;
  hypotheses_.push_back(h);
}

void Relocalizer::update_hypotheses(const Pose& T_body_cam, double age_s) {
  for (PoseHypothesis& h : hypotheses_) motion_.propagate(h, since_slice_, slices_ > 1);
  if (hypotheses_.empty()) return;
  SearchView view = view_from(hypotheses_.front().nav.T_map_body, T_body_cam);
  if (view.points.empty()) return;
  for (std::size_t i = 0; i < hypotheses_.size(); ++i) {
    // Poses of a wide search see other contours each.
    if (workspace_->widely && i > 0)
      view.points = view_from(hypotheses_[i].nav.T_map_body, T_body_cam).points;
    const bool refined = i < kRefined || slices_ >= kSlicesWithEdges;
    hypotheses_[i] = updated(hypotheses_[i], refined, view, age_s);
  }
  for (PoseHypothesis& h : hypotheses_) {
    h.mean_concentration += kNewestWeight * (h.concentration - h.mean_concentration);
    h.mean_support += kNewestWeight * (h.support - h.mean_support);
  }
  rank_hypotheses();
  if (slices_ + 1 >= kSlicesWithEdges) keep_hopeful();
}

void Relocalizer::rank_hypotheses() {
  std::ranges::stable_sort(hypotheses_, std::ranges::greater{}, &PoseHypothesis::mean_support);
  merge_duplicates(hypotheses_);
}

void Relocalizer::keep_hopeful() {
  if (hypotheses_.empty()) return;
  const double least = kHopefulShare * hypotheses_.front().mean_support;
  std::erase_if(hypotheses_, [&](const PoseHypothesis& h) { return h.mean_support < least; });
  const std::size_t most = wants_more_searches() ? kMostTogether : kRefined;
  if (hypotheses_.size() > most) hypotheses_.resize(most);
}

PoseHypothesis Relocalizer::updated(const PoseHypothesis& predicted, bool refined, const SearchView& view,
                                    double age_s) {
  PoseHypothesis h = predicted;
  if (refined) workspace_->refiner.refine(h, view.T_body_cam, slices_);
  if (slices_ < kSlicesWithEdges && (!refined || h.concentration < kLeastConcentration)) {
    // Perhaps the prediction was too far off: begins at the slice's edges instead.
    PoseHypothesis other = corrected_by_edges(predicted, view, age_s);
    if (refined) workspace_->refiner.refine(other, view.T_body_cam, slices_);
    if (!refined || other.support > h.support) h = other;
  }
  const Eigen::Quaterniond dq = predicted.nav.T_map_body.q.conjugate() * h.nav.T_map_body.q;
  if (!motion_.has_imu())
    h.angular_rate += (slices_ == 1 ? kFirstRateGain : kRateGain) /
                      std::max(since_slice_.dt_s, kLeastStep_s) * so3::log(dq);
  return h;
}

PoseHypothesis Relocalizer::corrected_by_edges(const PoseHypothesis& predicted, const SearchView& view,
                                               double age_s) const {
  PoseHypothesis out = predicted;
  out.concentration = out.support = 0;
  const Eigen::Vector3d rate = motion_.angular_rate(predicted, angular_rate_);
  const Pose then = carried_on(predicted.nav.T_map_body, predicted.nav.velocity, rate, -age_s);
  Vector6d information;
  information.head<3>().setConstant(1 / predicted.position_variance);
  information.tail<3>().setConstant(1 / (predicted.rotation_variance + std::pow(kEdgeRotationSigma_rad, 2)));
  const PoseGuess guess = refine_pose(view, then, information.asDiagonal(), refine_reach_px());
  correct_by_edges(out, guess.T_map_body.minus(then));
  return out;
}

/// The true pose may not be among those of a wide search at all.
bool Relocalizer::explains_enough(const PoseHypothesis& h) const {
  return !workspace_->widely || h.explained >= kLeastExplained;
}

bool Relocalizer::is_accepted(const PoseHypothesis& best) const {
  const bool compete = wants_more_searches();
  if ((compete && slices_ < kLastCompeting) || !explains_enough(best)) return false;
  return is_clear(hypotheses_, {compete, slices_ < kRivalSlices && !map_may_be_wrong_});
}

std::vector<Pose> Relocalizer::candidates() const {
  std::vector<Pose> out;
  if (slices_ < kLeastSlices) return out;
  const bool soon = slices_ < kRivalSlices && !map_may_be_wrong_;
  for (const PoseHypothesis& h : hypotheses_) {
    const bool alike = explains_enough(h) && h.mean_concentration >= kLeastConcentration &&
                       lead_over(h, soon) * h.mean_support > hypotheses_.front().mean_support;
    const bool apart =
        std::ranges::all_of(out, [&](const Pose& T) { return are_apart(h.nav.T_map_body, T); });
    if (alike && apart) out.push_back(h.nav.T_map_body);
  }
  if (out.size() < 2) out.clear();
  return out;
}

/// The best hypothesis if it is accepted; otherwise more slices are waited for, or the search starts anew.
std::optional<Relocalizer::Found> Relocalizer::accept_best() {
  if (slices_ < kLeastSlices) return {};
  if (!hypotheses_.empty()) {
    const PoseHypothesis& best = hypotheses_.front();
    if (is_accepted(best)) {
      const Eigen::Vector3d& p = best.nav.T_map_body.p;
      log_detail(text("pose found at ", p.x(), ", ", p.y(), ", ", p.z(), " m: ", best.support, " events, ",
                      100 * best.explained, " % of all, concentration ", best.mean_concentration));
      searching_ = false;
      return Found{best.nav, motion_.angular_rate(best, angular_rate_)};
    }
    if (!candidates().empty()) return {};
    const bool promising = best.mean_concentration >= kLowConcentration;
    const int more = wants_more_searches() ? kLastCompeting : 0;
    if (slices_ < more + (promising ? kMostSlices : kLeastSlices + 1)) return {};
  }
  // Anew, from where the prior has come to, and wider.
  slices_ = 0;
  ++searches_;
  return {};
}

}  // namespace evpose
