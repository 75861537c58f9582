// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "evpose/bench/experiments/recordings.h"

namespace evpose::experiments {

/// The tracker with some settings changed.
struct Variant {
  const char* name;
  bool imu;
  std::vector<std::string> settings;
  const char* preset = "";  ///< that the settings change
};

/// The back ends side by side.
const std::vector<Variant>& back_end_variants();
/// What each module of the tracker brings: all, and each left out.
const std::vector<Variant>& ablation_variants();
/// From the paper's form to the defaults, one replacement at a time; and the paper's own comparisons.
const std::vector<Variant>& paper_variants();

struct VariantsRequest {
  Selection selection;              ///< its assignments come after those of a variant
  std::vector<std::string> begins;  ///< how the names of the wanted variants begin; empty: all
  BenchRecording own;               ///< a recording to take instead of the folder's, if it has a folder
};

/// Tracks each recording with each variant and prints a table a recording.
Status print_variants(const std::vector<Variant>& variants, const VariantsRequest& request);

}  // namespace evpose::experiments
