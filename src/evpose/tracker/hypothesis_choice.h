// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>

#include "evpose/tracker/pose_hypothesis.h"

namespace evpose {

/// Gate concentration of a pose that may be taken if it leads. Wrong poses reach it, but not the support of
/// the true one.
inline constexpr double kLeastConcentration = 0.42;

/// Whether these are two poses, not one that is found twice.
bool are_apart(const Pose& a, const Pose& b);

/// So many times the support of that other one has to be reached. `soon`: it may not have come to its place
/// yet.
double lead_over(const PoseHypothesis& other, bool soon);

struct ChoiceRule {
  bool competing = false;  ///< searches in several slices have added to them: the map states errors
  bool soon = false;       ///< see lead_over()
};

/// The first of the hypotheses, best first, is to be taken: its events concentrate at the contours and it
/// leads the others, or it is far ahead of them. Where searches compete, one of several that have found it.
bool is_clear(std::span<const PoseHypothesis> best_first, const ChoiceRule& rule);

}  // namespace evpose
