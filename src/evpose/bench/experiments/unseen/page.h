// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "evpose/bench/experiments/unseen/result.h"
#include "evpose/bench/experiments/unseen/tracked_run.h"

namespace evpose::experiments::unseen {

/// What the page says of how it was made.
struct PageWords {
  std::string command;
  int seeds = 0;  ///< wanted; fewer results: the time was up
};

/// Errors over time as SVG: position with its stated sigma, and rotation; what is not called
/// `tracking` is shaded.
std::string course_picture(const ErrorCourse& course);

/// Names of a run's files beside the page.
std::string course_name(int seed, Given given);
std::string moment_name(int seed, Given given);

/// The worst of the seeds by mean ATE, the worst first; those without figures before them.
std::vector<const SeedResult*> worst(const std::vector<SeedResult>& results, Given given, std::size_t count);

inline constexpr std::size_t kWorst = 10;

/// The page, Markdown: distributions, classes, each seed, the ten worst with their pictures and all that was
/// drawn for them.
std::string page(const std::vector<SeedResult>& results, const PageWords& words);

}  // namespace evpose::experiments::unseen
