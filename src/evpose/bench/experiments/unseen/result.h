// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <string>
#include <vector>

#include "evpose/bench/experiments/unseen/draw.h"
#include "evpose/core/error.h"

namespace evpose::experiments::unseen {

/// What a flight is tracked with.
enum class Given { truth, built_map, handed_over, both };
inline constexpr std::array kGivenKinds{Given::truth, Given::built_map, Given::handed_over, Given::both};
inline constexpr std::size_t kGivens = kGivenKinds.size();
inline constexpr std::array<const char*, kGivens> kGivenNames{
    "true contours", "built map", "handed-over calibration", "built map and handed-over calibration"};
inline constexpr std::array<const char*, kGivens> kGivenKeys{"truth", "built_map", "handed_over", "both"};

/// One run, judged 0.3 s after its start.
struct RunFigures {
  std::string fault;  ///< why there are no figures; empty: there are
  double ate_mm = 0, ate_max_mm = 0, are_deg = 0;
  double nees6 = 0;  ///< mean of NEES / 6
  /// Likewise in the position's and the rotation's axes (body), and in the least known direction of each.
  std::array<double, 8> nees_by_direction{};
  double tracking = 0;         ///< share of the poses
  double ate_tracking_mm = 0;  ///< of those called `tracking`; 0: none is
  int poses = 0, silent = 0;   ///< silent: called `tracking` and beyond 5 sigma
  std::string at_end;          ///< health
};

/// What became of a seed.
struct SeedResult {
  int seed = 0;
  std::string key;  ///< of all that it depends on
  Draw draw;
  std::vector<std::string> refused;
  double duration_s = 0, mev_s = 0;
  std::array<RunFigures, kGivens> runs;
  bool of_other_program = false;  ///< taken from another run; not written

  const RunFigures& run(Given given) const { return runs[static_cast<std::size_t>(given)]; }
};

/// One line of JSON. What is read is what was written.
std::string to_json(const SeedResult& result);
/// Error: no such line; `where` names it.
Expected<SeedResult> from_json(const std::string& line, const std::string& where);

}  // namespace evpose::experiments::unseen
