// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "evpose/bench/experiments/unseen/result.h"

namespace evpose::experiments::unseen {

/// How a figure is spread over the seeds.
struct Distribution {
  double mean = 0, median = 0, p90 = 0, worst = 0;
};
/// Of values of which large ones are bad. All zero for none.
Distribution distribution(std::vector<double> values);

/// All seeds with one kind of input; runs without figures count as such and for the share of `tracking` only.
struct Summary {
  int seeds = 0, without_figures = 0;
  Distribution ate_mm, are_deg, nees6;
  Distribution ate_tracking_mm;               ///< of the poses called `tracking`, seeds that have some
  double tracking = 0, least_tracking = 0;    ///< share of the poses: mean over the seeds, and least
  int honest = 0;                             ///< seeds with NEES/6 within 0.5 .. 2
  std::array<double, 8> nees_by_direction{};  ///< means over the seeds, as RunFigures
  int weakest_beyond = 0;  ///< seeds with more than 2 in the least known direction of position or rotation
  int poses = 0, silent_poses = 0, silent_seeds = 0;
};
Summary summarise(const std::vector<SeedResult>& results, Given given);

/// Tables in Markdown, each line ending with a line break.
std::string summary_table(const std::vector<SeedResult>& results);
/// Mean and median ATE by the first word of what `words` tells of a draw.
std::string split_table(const std::vector<SeedResult>& results, const std::string& head,
                        const std::function<std::string(const Draw&)>& words);
std::string seed_table(const std::vector<SeedResult>& results);

/// Two runs over the same flights: differences by seed, in Markdown. Seeds that only one of them has, or that
/// were drawn otherwise, are left out and counted.
std::string comparison(const std::vector<SeedResult>& before, const std::vector<SeedResult>& after);

}  // namespace evpose::experiments::unseen
