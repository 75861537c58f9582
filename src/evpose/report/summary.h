// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>

#include "evpose/core/config.h"
#include "evpose/eval/score.h"
#include "evpose/report/run_folder.h"
#include "evpose/report/state_log.h"

namespace evpose {

/// Quantiles of wall time, milliseconds.
struct LatencyFigures {
  double p50_ms = 0, p99_ms = 0, max_ms = 0;
};

/// Of the updates and their stages; absent if no clock ran.
struct LatencySummary {
  LatencyFigures update;               ///< from the newest event to the pose: all stages but "events"
  std::vector<LatencyFigures> stages;  ///< in the order of kStageNames
};
std::optional<LatencySummary> summarise_latency(const StateLog& log);

/// "tracking", "degraded" or "lost": where the run ended. A tracker that has not reached "tracking" is "lost"
/// if it never saw anything, else "degraded".
std::string status_word(Health at_end);

/// The score as `evpose eval --json` prints it; words shared with summary.json.
std::string score_json(const TrajectoryScore& score);

/// The content of summary.json.
std::string summary_json(const StateLog& log, const RunSummary& summary, const ConfigTable& config,
                         const std::optional<TrajectoryScore>& score, const RunVerdict& verdict);

/// The score as a table for people; the last line has no line break.
std::string score_text(const TrajectoryScore& score);

/// Five lines for the terminal.
std::string summary_text(const StateLog& log, const RunSummary& summary,
                         const std::optional<TrajectoryScore>& score);

}  // namespace evpose
