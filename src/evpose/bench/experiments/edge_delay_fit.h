// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "evpose/bench/experiments/contour_looks.h"
#include "evpose/camera/trail_filter.h"

namespace evpose::experiments {

/// What of a sensor tells where its events lie behind a contour, first order in the speed: the threshold, by
/// the law of edge_delay.h, and the time constant of a low pass, which is a latency; brightening leaves it in
/// more light than darkening. The refractory period is not here: a pixel that pauses after each event makes
/// fewer of them, as evenly over the edge as without.
struct SensorDelay {
  double threshold = 0.25;                     ///< in log luminance
  double latency_on_s = 0, latency_off_s = 0;  ///< 1 / (2 pi bandwidth)

  static constexpr int kSize = 3;
  using Vector = Eigen::Matrix<double, kSize, 1>;
  Vector vector() const { return {threshold, latency_on_s, latency_off_s}; }
  static SensorDelay of(const Vector& v) { return {v[0], v[1], v[2]}; }
};

/// Events of the polarity that the contrast asks for, in one look at a contour.
struct DelaySample {
  std::uint32_t segment = 0;
  bool on = false;
  double crossing = 0;      ///< events of a pixel while the contour crosses it
  double speed_px_s = 0;    ///< >= 0
  double late_px = 0;       ///< behind the contour, measured
  double variance_px2 = 0;  ///< by the number of events
  double events = 0;
};

/// Of one recording. Looks at contours of little contrast tell nothing.
struct DelaySamples {
  TrailFilterSetting filter;
  std::vector<DelaySample> samples;
};
DelaySamples delay_samples(const std::vector<ContourLook>& looks, const TrailFilterSetting& filter);

/// px behind the contour, for each of the samples.
std::vector<double> delays_px(const DelaySamples& samples, const SensorDelay& sensor);

/// What of a sensor is free in a fit.
enum class DelayFreedom : std::uint8_t {
  all,
  handed_on  ///< what calibration and settings can say: threshold, one latency for both polarities
};

struct DelayFit {
  SensorDelay sensor;
  SensorDelay::Vector sigma = SensorDelay::Vector::Zero();  ///< by leaving out twentieths of the contours
  int samples = 0;
};

/// Least squares over all recordings of one sensor. With too few samples nothing is moved from
/// `SensorDelay{}`, and the sigmas are infinite.
DelayFit fit_delay(const std::vector<const DelaySamples*>& recordings, DelayFreedom freedom);

}  // namespace evpose::experiments
