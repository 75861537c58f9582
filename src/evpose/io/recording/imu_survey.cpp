// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/recording/imu_survey.h"

#include <algorithm>
#include <cmath>

namespace evpose {
namespace {

constexpr double kGapInIntervals = 2.5;
constexpr double kWindow_s = 0.25;
constexpr std::size_t kLeastWindows = 2;                      // half a second
constexpr double kRestGyro = 0.03, kRestAccel = 0.3;          // standard deviation of a sensor at rest
constexpr double kRestGyroStep = 0.02, kRestAccelStep = 0.1;  // of the mean, from window to window

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// A quarter of a second of samples [begin, end).
struct Window {
  std::size_t begin = 0, end = 0;
  Eigen::Vector3d gyro = Eigen::Vector3d::Zero(), accel = Eigen::Vector3d::Zero();  ///< means
  bool quiet = false;
};

Window window_of(const std::vector<ImuSample>& samples, std::size_t begin, std::size_t end) {
  Window w{begin, end};
  const auto n = static_cast<double>(end - begin);
  for (std::size_t i = begin; i < end; ++i) w.gyro += samples[i].gyro / n, w.accel += samples[i].accel / n;
  Eigen::Vector3d gyro = Eigen::Vector3d::Zero(), accel = Eigen::Vector3d::Zero();
  for (std::size_t i = begin; i < end; ++i) {
    gyro += (samples[i].gyro - w.gyro).cwiseAbs2() / n;
    accel += (samples[i].accel - w.accel).cwiseAbs2() / n;
  }
  w.quiet = end - begin >= 5 && gyro.maxCoeff() < kRestGyro * kRestGyro &&
            accel.maxCoeff() < kRestAccel * kRestAccel;
  return w;
}

std::vector<Window> windows_of(const std::vector<ImuSample>& samples) {
  std::vector<Window> out;
  const TimeNs length = from_seconds(kWindow_s);
  std::size_t begin = 0;
  for (std::size_t i = 1; i <= samples.size(); ++i) {
    if (i < samples.size() && samples[i].t - samples[begin].t < length && samples[i].t > samples[i - 1].t)
      continue;
    const bool whole = i < samples.size() && samples[i].t - samples[begin].t >= length;
    if (whole) out.push_back(window_of(samples, begin, i));
    begin = i;
  }
  return out;
}

/// Runs of quiet windows that follow one another and agree, as [first, last] windows.
std::vector<std::pair<std::size_t, std::size_t>> quiet_runs(const std::vector<Window>& windows) {
  std::vector<std::pair<std::size_t, std::size_t>> out;
  for (std::size_t i = 0; i < windows.size(); ++i) {
    if (!windows[i].quiet) continue;
    std::size_t last = i;
    while (last + 1 < windows.size() && windows[last + 1].quiet &&
           windows[last + 1].begin == windows[last].end &&
           (windows[last + 1].gyro - windows[last].gyro).norm() < kRestGyroStep &&
           (windows[last + 1].accel - windows[last].accel).norm() < kRestAccelStep)
      ++last;
    if (last - i + 1 >= kLeastWindows) out.emplace_back(i, last);
    i = last;
  }
  return out;
}

std::optional<ImuAtRest> find_rest(const std::vector<ImuSample>& samples, double rate_hz) {
  const auto windows = windows_of(samples);
  const auto runs = quiet_runs(windows);
  if (runs.empty()) return std::nullopt;
  ImuAtRest rest;
  std::size_t n = 0, pairs = 0;
  double gyro = 0, accel = 0;  // sums of squared differences of neighbours
  for (const auto& [first, last] : runs) {
    const std::size_t begin = windows[first].begin, end = windows[last].end;
    rest.total_s += to_seconds(samples[end - 1].t - samples[begin].t);
    Eigen::Vector3d mean_accel = Eigen::Vector3d::Zero();
    for (std::size_t i = begin; i < end; ++i) {
      rest.gyro_bias += samples[i].gyro;
      mean_accel += samples[i].accel / static_cast<double>(end - begin);
      if (i == begin) continue;
      gyro += (samples[i].gyro - samples[i - 1].gyro).squaredNorm();
      accel += (samples[i].accel - samples[i - 1].accel).squaredNorm();
      ++pairs;
    }
    n += end - begin;
    if (samples[end - 1].t - samples[begin].t <= rest.end - rest.begin) continue;
    rest.begin = samples[begin].t, rest.end = samples[end - 1].t;
    rest.accel = mean_accel;
  }
  rest.gyro_bias /= static_cast<double>(n);
  // Of white noise the difference of neighbours has twice the variance, on each of three axes.
  const double scale = 1 / (6 * static_cast<double>(pairs) * rate_hz);
  rest.gyro_density = std::sqrt(scale * gyro);
  rest.accel_density = std::sqrt(scale * accel);
  return rest;
}

}  // namespace

ImuSummary survey_imu(const std::vector<ImuSample>& samples) {
  ImuSummary out;
  out.count = static_cast<std::int64_t>(samples.size());
  if (samples.empty()) return out;
  out.first = samples.front().t, out.last = samples.back().t;
  const auto n = static_cast<double>(samples.size());
  std::vector<double> intervals;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const ImuSample& s = samples[i];
    out.mean_gyro += s.gyro / n, out.mean_accel += s.accel / n;
    out.mean_accel_norm += s.accel.norm() / n;
    out.largest_gyro = std::max(out.largest_gyro, s.gyro.norm());
    out.largest_accel = std::max(out.largest_accel, s.accel.norm());
    if (i == 0) continue;
    if (s.t <= samples[i - 1].t) {
      ++out.not_forward;
    } else {
      intervals.push_back(to_seconds(s.t - samples[i - 1].t));
    }
  }
  out.interval_s = median(intervals);
  std::vector<double> off;
  for (const double interval : intervals) off.push_back(std::abs(interval - out.interval_s));
  out.jitter_s = median(std::move(off));
  for (std::size_t i = 1; i < samples.size(); ++i)
    if (to_seconds(samples[i].t - samples[i - 1].t) > kGapInIntervals * out.interval_s)
      out.gaps.push_back({samples[i - 1].t, samples[i].t});
  out.gap_count = static_cast<std::int64_t>(out.gaps.size());
  std::stable_sort(out.gaps.begin(), out.gaps.end(),
                   [](const ImuGap& a, const ImuGap& b) { return a.end - a.begin > b.end - b.begin; });
  out.gaps.resize(std::min<std::size_t>(out.gaps.size(), 10));
  if (out.interval_s > 0) out.at_rest = find_rest(samples, out.rate_hz());
  return out;
}

}  // namespace evpose
