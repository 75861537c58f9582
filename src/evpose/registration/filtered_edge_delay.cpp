// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/filtered_edge_delay.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace evpose {
namespace {

constexpr int kPhases = 64;  // places of the first event that are tried
constexpr double kLargestStep = 12, kStepsApart = 0.125, kUsualStep = 3;
// How well the events per pixel swept are known: texture, the area that was swept.
constexpr double kCountSigma = 0.06, kRelativeCountSigma = 0.06;
constexpr double kLeastDelay_px = -0.5, kMostDelay_px = 0.5;  // beyond, no band looks for events

bool keeps(TrailFilterKind kind, int place) {
  switch (kind) {
    case TrailFilterKind::first:
      return place == 1;
    case TrailFilterKind::second:
      return place == 2;
    case TrailFilterKind::all_but_first:
      return place >= 2;
    case TrailFilterKind::none:
      break;
  }
  return true;
}

}  // namespace

FilteredEvents filtered_events(TrailFilterKind kind, double thresholds, double threshold, int sign,
                               double gap_px) {
  const double whole = std::expm1(sign * thresholds * threshold);
  FilteredEvents out;
  for (int phase = 0; phase < kPhases; ++phase) {
    // The first event comes within two thresholds, by the odds of a triangle.
    const double first = 2 * (phase + 0.5) / kPhases;
    const double odds = 2.0 / kPhases * (first < 1 ? first : 2 - first);
    int place = 0;
    double before_px = 0;
    for (double u = first; u <= thresholds; ++u) {
      const double at_px = std::expm1(sign * u * threshold) / whole;
      place = place > 0 && at_px - before_px < gap_px ? place + 1 : 1;
      before_px = at_px;
      if (!keeps(kind, place)) continue;
      out.events += odds;
      out.delay_px += odds * (at_px - 0.5);
    }
  }
  if (out.events > 0) out.delay_px /= out.events;
  return out;
}

FilteredEdgeDelay::Row FilteredEdgeDelay::make_row(TrailFilterKind kind, double threshold, int sign,
                                                   double gap_px) {
  std::vector<FilteredEvents> steps;
  for (double step = kStepsApart; step <= kLargestStep; step += kStepsApart)
    steps.push_back(filtered_events(kind, step, threshold, sign, gap_px));
  Row out;
  for (std::size_t i = 0; i < out.size(); ++i) {
    const bool known = i + 1 < out.size();
    const double events = static_cast<double>(i) / kPerEvent,
                 sigma = kCountSigma + kRelativeCountSigma * events;
    double sum = 0, mean = 0, square = 0;
    for (std::size_t k = 0; k < steps.size(); ++k) {
      if (steps[k].events <= 0) continue;
      const double off = known ? (steps[k].events - events) / sigma : 0;
      // The further term keeps the odds finite where no step makes so many events.
      const double odds = (std::exp(-0.5 * off * off) + 1e-6 / (1 + off * off)) *
                          std::exp(-static_cast<double>(k + 1) * kStepsApart / kUsualStep) *
                          (known ? 1 : steps[k].events);
      sum += odds;
      mean += odds * steps[k].delay_px;
      square += odds * steps[k].delay_px * steps[k].delay_px;
    }
    if (sum <= 0) continue;
    mean /= sum;
    out[i] = {std::clamp(mean, kLeastDelay_px, kMostDelay_px), std::max(0.0, square / sum - mean * mean)};
  }
  return out;
}

FilteredEdgeDelay::FilteredEdgeDelay(const TrailFilterSetting& filter, double threshold)
    : longest_gap_s_(filter.longest_gap_s) {
  for (int i = 0; i < kGaps; ++i) {
    const double gap_px = kLeastGap_px * std::pow(kMostGap_px / kLeastGap_px, i / (kGaps - 1.0));
    on_[static_cast<std::size_t>(i)] = make_row(filter.kind, threshold, 1, gap_px);
    off_[static_cast<std::size_t>(i)] = make_row(filter.kind, threshold, -1, gap_px);
  }
}

FilteredEdgeDelay::Value FilteredEdgeDelay::operator()(double events, double speed_px_s) const {
  const double gap_px = std::clamp(speed_px_s * longest_gap_s_, kLeastGap_px, kMostGap_px);
  const double row = (kGaps - 1) * std::log(gap_px / kLeastGap_px) / std::log(kMostGap_px / kLeastGap_px);
  const auto low = std::min(static_cast<std::size_t>(row), static_cast<std::size_t>(kGaps - 2));
  const double rest = row - static_cast<double>(low);
  const auto column = events < 0 ? std::tuple_size_v<Row> - 1
                                 : static_cast<std::size_t>(std::lround(
                                       kPerEvent * std::min(events, static_cast<double>(kMostEvents))));
  const auto read = [&](const std::array<Row, kGaps>& rows) {
    const Cell &a = rows[low][column], &b = rows[low + 1][column];
    return Cell{a.mean_px + rest * (b.mean_px - a.mean_px),
                a.variance_px2 + rest * (b.variance_px2 - a.variance_px2)};
  };
  const Cell on = read(on_), off = read(off_);
  return {{on.mean_px, off.mean_px}, std::sqrt(std::max(on.variance_px2, off.variance_px2))};
}

}  // namespace evpose
