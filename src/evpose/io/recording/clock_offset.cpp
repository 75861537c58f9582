// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/recording/clock_offset.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace evpose {
namespace {

constexpr std::size_t kCoarse = 5;            // steps of the curves, in a step of the search
constexpr double kLeastCommon_s = 3;          // of both streams, and
constexpr double kCommonShare = 2.0 / 3;      // of the shorter one
constexpr double kLeastCorrelation = 0.5;     // else something else than turning made the events
constexpr double kLeastLead = 0.1;            // before any shift further off: else the motion repeats itself
constexpr double kSameMotion_s = 0.5;         // shifts as near as this are of one and the same motion
constexpr double kLeastTurning_rad_s = 0.05;  // root mean square

/// A value for each step of time. Square roots, so that single bursts do not decide.
struct Curve {
  TimeNs begin = 0;
  TimeNs step = 1;
  std::vector<float> values;

  std::ptrdiff_t size() const { return static_cast<std::ptrdiff_t>(values.size()); }
  Curve thinned(std::size_t by) const {
    Curve out{begin, step * static_cast<TimeNs>(by), {}};
    for (std::size_t k = 0; k + by <= values.size(); k += by) {
      float sum = 0;
      for (std::size_t i = k; i < k + by; ++i) sum += values[i];
      out.values.push_back(sum / static_cast<float>(by));
    }
    return out;
  }
};

Curve curve_of(const EventSummary& events) {
  Curve out{events.first, EventSummary::kHundredth, {}};
  for (const std::uint32_t n : events.hundredths) out.values.push_back(std::sqrt(static_cast<float>(n)));
  return out;
}

/// The size of the angular rate, averaged over each step, or of the sample before where a step has none.
Curve curve_of(const std::vector<ImuSample>& imu, TimeNs step) {
  Curve out{imu.front().t, step, {}};
  std::size_t i = 0;
  double last = imu.front().gyro.norm();
  for (TimeNs end = out.begin + step; end <= imu.back().t; end += step) {
    double sum = 0;
    int count = 0;
    for (; i < imu.size() && imu[i].t < end; ++i, ++count) sum += imu[i].gyro.norm();
    if (count > 0) last = sum / count;
    out.values.push_back(static_cast<float>(std::sqrt(last)));
  }
  return out;
}

/// Correlation of a's values with b's `lag` steps later; 0 where they have fewer than `least` in common.
double correlation(const Curve& a, const Curve& b, std::ptrdiff_t lag, std::ptrdiff_t least) {
  const std::ptrdiff_t from = std::max<std::ptrdiff_t>(0, -lag), to = std::min(a.size(), b.size() - lag);
  if (to - from < least) return 0;
  double sa = 0, sb = 0, saa = 0, sbb = 0, sab = 0;
  const float* const x = a.values.data();
  const float* const y = b.values.data() + lag;
  for (std::ptrdiff_t i = from; i < to; ++i) {
    sa += x[i], sb += y[i];
    saa += x[i] * x[i], sbb += y[i] * y[i], sab += x[i] * y[i];
  }
  const double n = static_cast<double>(to - from);
  const double spread = (saa - sa * sa / n) * (sbb - sb * sb / n);
  return spread > 1e-12 ? (sab - sa * sb / n) / std::sqrt(spread) : 0;
}

struct Best {
  std::ptrdiff_t lag = 0;
  double correlation = 0, elsewhere = 0;  ///< there, and the greatest of another motion
};

Best search(const Curve& a, const Curve& b, std::ptrdiff_t least) {
  std::vector<double> all;
  for (std::ptrdiff_t lag = -a.size(); lag <= b.size(); ++lag) all.push_back(correlation(a, b, lag, least));
  const auto top = std::max_element(all.begin(), all.end()) - all.begin();
  Best out{top - a.size(), all[static_cast<std::size_t>(top)], 0};
  const auto near = static_cast<std::ptrdiff_t>(kSameMotion_s / to_seconds(a.step));
  for (std::ptrdiff_t i = 0; i < static_cast<std::ptrdiff_t>(all.size()); ++i)
    if (std::abs(i - top) > near) out.elsewhere = std::max(out.elsewhere, all[static_cast<std::size_t>(i)]);
  return out;
}

/// The top of the parabola through three neighbours, in steps off the one in the middle.
double top_of_parabola(double before, double at, double after) {
  const double bend = before - 2 * at + after;
  return bend < -1e-12 ? std::clamp(0.5 * (before - after) / bend, -1.0, 1.0) : 0;
}

bool turns(const std::vector<ImuSample>& imu) {
  double square = 0;
  for (const ImuSample& s : imu) square += s.gyro.squaredNorm();
  return std::sqrt(square / static_cast<double>(imu.size())) > kLeastTurning_rad_s;
}

}  // namespace

std::optional<ClockOffset> find_clock_offset(const EventSummary& events, const std::vector<ImuSample>& imu) {
  if (imu.size() < 2 || events.count == 0 || !turns(imu)) return {};
  const Curve a = curve_of(events), b = curve_of(imu, a.step);
  const double step_s = to_seconds(a.step);
  const auto least = static_cast<std::ptrdiff_t>(
      std::max(kLeastCommon_s / step_s, kCommonShare * static_cast<double>(std::min(a.size(), b.size()))));
  const auto coarse = static_cast<std::ptrdiff_t>(kCoarse);
  const Best best = search(a.thinned(kCoarse), b.thinned(kCoarse), least / coarse);
  if (best.correlation < kLeastCorrelation || best.correlation - best.elsewhere < kLeastLead) return {};
  std::ptrdiff_t lag = best.lag * coarse;
  double there = 0;
  for (std::ptrdiff_t at = best.lag * coarse - 2 * coarse; at <= best.lag * coarse + 2 * coarse; ++at)
    if (const double c = correlation(a, b, at, least); c > there) there = c, lag = at;
  const double part =
      top_of_parabola(correlation(a, b, lag - 1, least), there, correlation(a, b, lag + 1, least));
  ClockOffset out;
  out.offset_s = (static_cast<double>(lag) + part) * step_s + to_seconds(b.begin - a.begin);
  out.correlation = there;
  const auto as_read = static_cast<std::ptrdiff_t>(std::llround(to_seconds(a.begin - b.begin) / step_s));
  out.as_read = correlation(a, b, as_read, least);
  return out;
}

}  // namespace evpose
