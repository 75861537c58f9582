// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/hypothesis_choice.h"

namespace evpose {
namespace {

constexpr double kLeastLead = 1.15;  // over the next pose, in support
constexpr double kRivalLead = 1.5;   // over one that is concentrated, too
constexpr double kRival_m = 0.02, kRival_rad = 0.007;

// So far ahead, a lower concentration is enough; even: 0.15.
constexpr double kClearLead = 2, kAloneConcentration = 0.22;

// Where searches compete, in a map whose contours scatter by centimetres.
constexpr int kFoundBy = 2, kFoundByMany = 3;  // searches; the latter for the lower concentration
constexpr double kClearLeadOfMany = 1.5;
constexpr double kNeighbour_m = 0.04, kNeighbour_rad = 0.014;  // no other place

bool differ_by(const Pose& a, const Pose& b, double by_m, double by_rad) {
  const Vector6d d = a.minus(b);
  return d.head<3>().norm() >= by_m || d.tail<3>().norm() >= by_rad;
}

}  // namespace

bool are_apart(const Pose& a, const Pose& b) { return differ_by(a, b, kRival_m, kRival_rad); }

double lead_over(const PoseHypothesis& other, bool soon) {
  return soon && other.mean_concentration >= kLeastConcentration ? kRivalLead : kLeastLead;
}

bool is_clear(std::span<const PoseHypothesis> best_first, const ChoiceRule& rule) {
  if (best_first.empty()) return false;
  const PoseHypothesis& best = best_first.front();
  const Pose& T = best.nav.T_map_body;
  bool leads = best.mean_concentration >= kLeastConcentration && (!rule.competing || best.found >= kFoundBy);
  bool alone =
      best.mean_concentration >= kAloneConcentration && (!rule.competing || best.found >= kFoundByMany);
  const double clear_lead = rule.competing ? kClearLeadOfMany : kClearLead;
  for (const PoseHypothesis& h : best_first) {
    const Pose& other = h.nav.T_map_body;
    if (!are_apart(other, T)) continue;
    leads &= best.mean_support >= lead_over(h, rule.soon) * h.mean_support;
    const bool beside = rule.competing && !differ_by(other, T, kNeighbour_m, kNeighbour_rad);
    alone &= beside || best.mean_support >= clear_lead * h.mean_support;
  }
  return leads || alone;
}

}  // namespace evpose
