// SPDX-License-Identifier: BSD-3-Clause
// Where hypotheses come from beside the first search of a slice.
#include <utility>

#include "evpose/relocalization/pose_aliases.h"
#include "evpose/tracker/relocalizer.h"

namespace evpose {
namespace {

constexpr std::size_t kNewcomers = 6;             // of each search that competes
constexpr double kFoundVelocitySpread_m_s = 0.3;  // wrong poses tell the velocity, too
constexpr int kAliasRounds = 3;                   // a period may lie along each direction

}  // namespace

/// A map that has few of the contours, and some where none are, lets wrong poses find support, and one search
/// may miss the right one: what searches in other events find is added to the hypotheses.
void Relocalizer::search_again(const Pose& T_body_cam, double age_s) {
  go_on_with_velocity_found();
  std::vector<PoseHypothesis> all = std::exchange(hypotheses_, {});
  search_around_prior(T_body_cam, age_s);
  if (hypotheses_.size() > kNewcomers) hypotheses_.resize(kNewcomers);
  for (PoseHypothesis& h : hypotheses_) h.newest_search = draws_;
  all.insert(all.end(), hypotheses_.begin(), hypotheses_.end());
  hypotheses_ = std::move(all);
  rank_hypotheses();
  keep_hopeful();
}

/// The prior has gone on with the velocity of the start, which may be wrong by metres per second.
void Relocalizer::go_on_with_velocity_found() {
  if (hypotheses_.empty() || hypotheses_.front().mean_concentration < kLowConcentration) return;
  const Eigen::Vector3d off = hypotheses_.front().nav.velocity - prior_.velocity;
  prior_.T_map_body.p += elapsed_s_ * off;
  prior_.velocity += off;
  velocity_sigma_m_s_ = kFoundVelocitySpread_m_s;
}

/// Repetitive places have many poses that explain the events, of which a search around a wrong start may not
/// have reached the true one. Along the map's directions the next are found, until none has more support.
void Relocalizer::add_aliases(const Pose& T_body_cam, double age_s) {
  for (int round = 0; round < kAliasRounds && !hypotheses_.empty(); ++round) {
    const PoseHypothesis best = hypotheses_.front();
    const Eigen::Vector3d rate = motion_.angular_rate(best, angular_rate_);
    const Pose then = carried_on(best.nav.T_map_body, best.nav.velocity, rate, -age_s);
    const auto view = [&](const Pose& T_map_body) { return view_from(T_map_body, T_body_cam); };
    for (const PoseGuess& guess : find_aliases(then, workspace_->attitudes.directions(), view)) {
      PoseHypothesis alias = best;
      alias.nav.T_map_body = carried_on(guess.T_map_body, best.nav.velocity, rate, age_s);
      workspace_->refiner.refine(alias, T_body_cam, slices_);
      alias.mean_concentration = alias.concentration;
      // As if it had been seen for as long.
      alias.mean_support = best.support > 0 ? alias.support * best.mean_support / best.support : 0;
      alias.found = 1;
      hypotheses_.push_back(alias);
    }
    rank_hypotheses();
    keep_hopeful();
    if (hypotheses_.front().mean_support <= best.mean_support) return;
  }
}

}  // namespace evpose
