// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <string>
#include <vector>

#include "evpose/core/error.h"
#include "evpose/report/state_log.h"

namespace evpose {

/// Share of the updates that must be "tracking" in a good run.
inline constexpr double kGoodTrackingShare = 0.9;

/// A reason for which a run was not tracking.
struct RunProblem {
  Health health = Health::waiting;  ///< the worst that it came to
  std::string reason;               ///< as the tracker told it last
  double total_s = 0;               ///< how long in all
  TimeNs last = 0;                  ///< when it began the last time
  std::string cause, remedy;        ///< what is likely behind it, and what to do
};

/// How a run went as a whole.
struct RunVerdict {
  /// Of the updates; those while the first events are collected (up to 0.1 s) do not count. 0 without
  /// updates.
  double tracking_share = 0;
  double length_s = 0;               ///< of data
  std::vector<RunProblem> problems;  ///< one for each cause, the longest first; a search last
  bool good() const { return tracking_share >= kGoodTrackingShare; }
};

/// Whether an update counts in the share that was tracked: not while the first events are collected.
bool counts_in_share(Health health, double since_first_s);

RunVerdict judge_run(const StateLog& log);

/// Of changes of health in order of time, the last of which lasted until `end`: all but tracking.
std::vector<RunProblem> problems_of(std::span<const HealthChange> changes, TimeNs end);

/// Likely cause and remedy of a reason as the tracker gives it.
Error explain_reason(const std::string& reason);

/// For the terminal: the share and, of a run that is not good or has problems that lasted, the `findings` of
/// before the run and the longest problems, with what to do. The last line has no line break.
std::string verdict_text(const RunVerdict& verdict, const std::vector<Error>& findings);

}  // namespace evpose
