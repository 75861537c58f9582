// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "evpose/core/pose.h"
#include "evpose/eval/score.h"
#include "evpose/report/run_folder.h"
#include "evpose/report/state_log.h"

namespace evpose {

/// A picture of the report.
struct OverlayPicture {
  std::string caption;
  std::string png;  ///< bytes
  int width = 0, height = 0;
};

/// All that the page of a run is made of.
struct RunPage {
  const StateLog& log;
  const RunSummary& summary;
  const ConfigTable& config;
  const std::optional<TrajectoryScore>& score;
  std::span<const OverlayPicture> overlays;
};

/// report.html of a run: one file that needs nothing else.
std::string run_page(const RunPage& run);

/// The same page for a trajectory that was merely judged.
std::string score_page(const std::string& title, const std::string& subtitle, const TrajectoryScore& score,
                       std::span<const TimedPose> truth);

/// The page's shell around its data (JSON), with both made safe: neither the title nor text inside the data
/// can end its element.
std::string page_html(const std::string& title, const std::string& data_json);

}  // namespace evpose
