// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/bench/experiments/edge_delay_fit.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "evpose/registration/contrast_memory.h"

namespace evpose::experiments {
namespace {

constexpr double kFullDelay_px_s = 20;  // as the registration has it
constexpr double kSegments_px = 0.15;   // what contours are off by themselves, 1 sigma
constexpr int kFewest = 60;             // samples
constexpr std::size_t kGroups = 20;     // of contours, for the sigmas
constexpr int kIterations = 8;
constexpr double kLeastThreshold = 0.05, kMostThreshold = 1;

using Vector = SensorDelay::Vector;
using Matrix = Eigen::Matrix<double, SensorDelay::kSize, SensorDelay::kSize>;
using Columns = Eigen::Matrix<double, SensorDelay::kSize, Eigen::Dynamic>;
using Law = std::function<EdgeDelay(double events, double speed_px_s)>;

/// That of the threshold alone, as ContrastMemory asks for it.
Law law_of(const TrailFilterSetting& filter, double threshold) {
  if (filter.kind == TrailFilterKind::none)
    return
        [table = EdgeDelayTable(threshold)](double events, double) { return table(step_of_events(events)); };
  return [table = FilteredEdgeDelay(filter, threshold)](double events, double speed_px_s) {
    return table(events, speed_px_s).delay;
  };
}

double delay_px(const DelaySample& s, const Law& law, const SensorDelay& sensor) {
  const EdgeDelay still = law(s.crossing, s.speed_px_s);
  const double fade = std::min(1.0, s.speed_px_s / kFullDelay_px_s);
  const double late_s = s.on ? sensor.latency_on_s : sensor.latency_off_s;
  return fade * (s.on ? still.on_px : still.off_px) + s.speed_px_s * late_s;
}

/// How the sensor follows from what is free, as columns.
Columns columns_of(DelayFreedom freedom) {
  if (freedom == DelayFreedom::all) return Matrix::Identity();
  Columns out = Columns::Zero(SensorDelay::kSize, 2);
  out(0, 0) = out(1, 1) = out(2, 1) = 1;
  return out;
}

/// Normal equations by groups of contours.
struct Normal {
  Matrix information = Matrix::Zero();
  Vector gradient = Vector::Zero();
};
using Groups = std::array<Normal, kGroups>;

void add(const DelaySamples& recording, const SensorDelay& at, Groups& groups) {
  constexpr double kStep = 0.01;  // of the threshold
  const Law law = law_of(recording.filter, at.threshold);
  const Law more = law_of(recording.filter, at.threshold + kStep);
  std::uint32_t most = 1;
  for (const DelaySample& s : recording.samples) most = std::max(most, s.segment + 1);
  for (const DelaySample& s : recording.samples) {
    const double here = delay_px(s, law, at);
    Vector slope(0, s.on ? s.speed_px_s : 0, s.on ? 0 : s.speed_px_s);
    slope[0] = (delay_px(s, more, at) - here) / kStep;
    const double weight = 1 / (s.variance_px2 + kSegments_px * kSegments_px);
    Normal& n = groups[kGroups * s.segment / most];
    n.information += weight * slope * slope.transpose();
    n.gradient += weight * (s.late_px - here) * slope;
  }
}

Eigen::VectorXd step_of(const Normal& n, const Columns& columns) {
  const Eigen::MatrixXd information = columns.transpose() * n.information * columns;
  return information.ldlt().solve(columns.transpose() * n.gradient);
}

Normal sum_of(const Groups& groups, std::size_t without) {
  Normal out;
  for (std::size_t g = 0; g < kGroups; ++g)
    if (g != without) out.information += groups[g].information, out.gradient += groups[g].gradient;
  return out;
}

/// By the steps that the fit would take without each group (jackknife).
Vector sigma_of(const Groups& groups, const Columns& columns) {
  Vector sum = Vector::Zero(), square = Vector::Zero();
  double n = 0;
  for (std::size_t g = 0; g < kGroups; ++g) {
    if (groups[g].information.isZero(0)) continue;
    const Vector step = columns * step_of(sum_of(groups, g), columns);
    sum += step, square += step.cwiseAbs2(), n += 1;
  }
  return ((n - 1) / n * (square - sum.cwiseAbs2() / n)).cwiseMax(0).cwiseSqrt();
}

}  // namespace

DelaySamples delay_samples(const std::vector<ContourLook>& looks, const TrailFilterSetting& filter) {
  constexpr double kLeastEvents = 8;
  DelaySamples out{filter, {}};
  for (const ContourLook& l : looks) {
    const OffsetSum& sum = l.steps > 0 ? l.on : l.off;
    const double n = sum.events();
    if (std::abs(l.steps) < ContrastMemory::kSureSteps || n < kLeastEvents) continue;
    out.samples.push_back({l.segment, l.steps > 0, std::abs(l.steps), l.speed_px_s, -sum.sum_px() / n,
                           sum.variance_px2() / (n * n), n});
  }
  return out;
}

std::vector<double> delays_px(const DelaySamples& samples, const SensorDelay& sensor) {
  const Law law = law_of(samples.filter, sensor.threshold);
  std::vector<double> out;
  for (const DelaySample& s : samples.samples) out.push_back(delay_px(s, law, sensor));
  return out;
}

DelayFit fit_delay(const std::vector<const DelaySamples*>& recordings, DelayFreedom freedom) {
  const Columns columns = columns_of(freedom);
  DelayFit out;
  for (const DelaySamples* r : recordings) out.samples += static_cast<int>(r->samples.size());
  out.sigma.setConstant(std::numeric_limits<double>::infinity());
  if (out.samples < kFewest) return out;
  Groups groups;
  Vector at = out.sensor.vector();
  for (int i = 0; i <= kIterations; ++i) {
    groups = {};
    for (const DelaySamples* r : recordings) add(*r, SensorDelay::of(at), groups);
    if (i == kIterations) break;
    at += columns * step_of(sum_of(groups, kGroups), columns);
    at[0] = std::clamp(at[0], kLeastThreshold, kMostThreshold);
  }
  out.sensor = SensorDelay::of(at);
  out.sigma = sigma_of(groups, columns);
  return out;
}

}  // namespace evpose::experiments
