// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/pose_probability.h"

#include <algorithm>
#include <cmath>

namespace evpose {
namespace {

constexpr double kGiven = 4;                  // log-odds: 98 %
constexpr double kIndependent_s = 0.05;       // apart, looks count as different ones
constexpr double kSurest = 10, kLeast = -20;  // log-odds: what was seen long ago is no proof for ever
constexpr double kLeastRatio = 0.05, kMostRatio = 10;

}  // namespace

// Logistic regression of looks at right and wrong poses: benchmarks/run.py probability.
double PoseProbability::log_odds(const PoseEvidence& look, double gate_concentration) {
  const double ratio = std::log(std::max(look.ratio, kLeastRatio));
  const double worst = std::log(std::clamp(look.worst_ratio, kLeastRatio, kMostRatio));
  return -6.8 - 4.3 * ratio + 1.1 * ratio * ratio + 3.8 * worst + 19 * look.explained -
         0.5 * std::log10(std::max(look.pieces, 1.0)) + 17 * gate_concentration;
}

void PoseProbability::given() { log_odds_ = kGiven; }

void PoseProbability::found() { log_odds_ = 0; }

void PoseProbability::confirm() { log_odds_ = kSurest; }

void PoseProbability::add(const PoseEvidence& look, double gate_concentration, double span_s) {
  if (look.pieces == 0) return;
  const double told = log_odds(look, gate_concentration) * span_s / kIndependent_s;
  log_odds_ = std::clamp(log_odds_ + told, kLeast, kSurest);
}

double PoseProbability::value() const { return 1 / (1 + std::exp(-log_odds_)); }

}  // namespace evpose
