// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/relocalization/pose_aliases.h"

#include <algorithm>
#include <cmath>
#include <functional>

namespace evpose {
namespace {

constexpr double kReach_m = 6;       // two periods of storeys or windows
constexpr double kStep_m = 0.02;     // less than the edges' coarse kernel, some metres away
constexpr int kStepsOfOneView = 24;  // in which much the same is seen
constexpr double kNoAlias_m = 0.1;   // this near it is the pose itself
constexpr std::size_t kDirections = 3, kMost = 6;
constexpr std::size_t kFewestPoints = 40;
constexpr double kPositionSigma_m = 0.1, kRotationSigma_rad = 0.01;  // of an alias before it is refined

/// A pose moved along one of the directions.
struct Step {
  Pose T_map_body;
  double way_m, score;
};

Pose moved(const Pose& T, const Eigen::Vector3d& by) { return {T.q, T.p + by}; }

/// Scores of the poses along a direction; where too little is seen, less than any.
std::vector<Step> scores_along(const Pose& from, const Eigen::Vector3d& axis, const ViewFrom& view_from) {
  std::vector<Step> out;
  const int half = static_cast<int>(kReach_m / kStep_m);
  for (int first = -half; first <= half; first += kStepsOfOneView) {
    const int middle = first + kStepsOfOneView / 2;
    const SearchView view = view_from(moved(from, kStep_m * middle * axis));
    for (int i = first; i < first + kStepsOfOneView; ++i) {
      const Pose T = moved(from, kStep_m * i * axis);
      out.push_back(
          {T, kStep_m * i,
           view.points.size() < kFewestPoints ? -HUGE_VAL : score_pose(view, T, EdgeSpread::coarse)});
    }
  }
  return out;
}

void add_peaks(const std::vector<Step>& steps, std::vector<Step>& peaks) {
  for (std::size_t i = 1; i + 1 < steps.size(); ++i)
    if (steps[i].score > steps[i - 1].score && steps[i].score >= steps[i + 1].score &&
        std::abs(steps[i].way_m) > kNoAlias_m)
      peaks.push_back(steps[i]);
}

}  // namespace

std::vector<PoseGuess> find_aliases(const Pose& T_map_body, std::span<const MapDirection> directions,
                                    const ViewFrom& view_from) {
  std::vector<Step> peaks;
  for (const MapDirection& d : directions.first(std::min(kDirections, directions.size())))
    add_peaks(scores_along(T_map_body, d.axis, view_from), peaks);
  std::ranges::stable_sort(peaks, std::ranges::greater{}, &Step::score);
  if (peaks.size() > kMost) peaks.resize(kMost);
  Vector6d information;
  information.head<3>().setConstant(1 / (kPositionSigma_m * kPositionSigma_m));
  information.tail<3>().setConstant(1 / (kRotationSigma_rad * kRotationSigma_rad));
  std::vector<PoseGuess> out;
  for (const Step& peak : peaks)
    out.push_back(refine_pose(view_from(peak.T_map_body), peak.T_map_body, information.asDiagonal(),
                              refine_reach_px()));
  return out;
}

}  // namespace evpose
