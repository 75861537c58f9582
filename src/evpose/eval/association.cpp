// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/eval/association.h"

#include <algorithm>

namespace evpose {
namespace {

std::vector<TimedPose> without_repeats(std::span<const TimedPose> poses) {
  std::vector<TimedPose> out;
  out.reserve(poses.size());
  for (const TimedPose& p : poses)
    if (out.empty() || p.t > out.back().t) out.push_back(p);
  return out;
}

/// Index of the first of the two ground-truth poses around t; at the borders, of the outermost two.
std::size_t segment(const std::vector<TimedPose>& truth, TimeNs t) {
  const auto after =
      std::upper_bound(truth.begin(), truth.end(), t, [](TimeNs a, const TimedPose& p) { return a < p.t; });
  const auto i = std::clamp<std::ptrdiff_t>(after - truth.begin() - 1, 0, std::ssize(truth) - 2);
  return static_cast<std::size_t>(i);
}

}  // namespace

std::vector<PosePair> associate(std::span<const TimedPose> estimate, std::span<const TimedPose> truth,
                                const AssociationOptions& options) {
  const std::vector<TimedPose> poses = without_repeats(truth);
  std::vector<PosePair> pairs;
  if (poses.size() < 2) return pairs;
  const TimeNs max_gap = from_seconds(options.max_gap_s);
  const TimeNs max_difference = from_seconds(options.max_difference_s);
  for (std::size_t k = 0; k < estimate.size(); ++k) {
    const TimeNs t = estimate[k].t;
    if (!pairs.empty() && t <= pairs.back().t) continue;
    const std::size_t i = segment(poses, t);
    const TimedPose &a = poses[i], &b = poses[i + 1];
    PosePair pair{k, t, estimate[k].pose, {}, (b.pose.p - a.pose.p) / to_seconds(b.t - a.t)};
    if (options.rule == AssociationRule::interpolate) {
      if (t < a.t || t > b.t || b.t - a.t > max_gap) continue;
      pair.truth = interpolate(a.pose, b.pose, to_seconds(t - a.t) / to_seconds(b.t - a.t));
    } else {
      const TimedPose& near = std::abs(t - a.t) <= std::abs(b.t - t) ? a : b;
      if (std::abs(near.t - t) > max_difference) continue;
      pair.truth = near.pose;
    }
    pairs.push_back(pair);
  }
  return pairs;
}

}  // namespace evpose
