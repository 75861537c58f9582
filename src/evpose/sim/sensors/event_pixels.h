// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/sim/sensors/sim_event.h"
#include "evpose/sim/world/random.h"

namespace evpose::sim {

/// Pixel model of an event camera.
struct EventCameraConfig {
  double threshold_on = 0.25;           ///< contrast threshold: rise of log luminance that triggers an event
  double threshold_off = 0.25;          ///< contrast threshold: fall of log luminance that triggers an event
  double threshold_sigma = 0.03;        ///< mismatch between pixels, drawn for on and off separately
  double refractory_us = 100;           ///< refractory period: the pixel is held in reset after an event
  double dark_cd_m2 = 0.05;             ///< dark current, as luminance added to every pixel
  double bandwidth_hz_per_cd_m2 = 100;  ///< bandwidth of the photoreceptor by luminance; 0: unlimited
  double bandwidth_max_hz = 3000;      ///< limit of the bandwidth in bright light: the two time constants add
  double leak_hz = 0.1;                ///< leak events per pixel and second, by drift of the reference
  double shot_noise_dark_hz = 0.9;     ///< shot noise events per pixel and second in darkness
  double shot_noise_bright_hz = 0.14;  ///< the same in bright light
  double shot_noise_half_cd_m2 = 5;    ///< luminance at which the rate is half-way between the two
  double hot_pixel_fraction = 4e-5;    ///< fraction of hot pixels
  double hot_min_hz = 20, hot_max_hz = 600;  ///< range of their rates, log-uniform
  double reference_spread =
      1;  ///< initial offset of the reference from the signal, up to this fraction of the threshold
};

/// Each pixel low-pass filters its log luminance, compares it with the reference of the last reset, and
/// triggers an event when the change exceeds its threshold. A reset takes the refractory period and sets the
/// reference to the signal at its end. The reference leaks downwards; shot noise and hot pixels add noise
/// events.
///
/// The events of a pixel depend on its luminance, its number and the seed only, and barely on how a luminance
/// curve is divided into spans: not at all without the low pass; with it log luminance is taken as linear
/// over changes of up to a tenth.
class EventPixels {
 public:
  EventPixels(ImageSize size, const EventCameraConfig& config, std::uint64_t seed);

  /// Initializes a pixel with its first luminance.
  void start(std::size_t pixel, TimeNs t, float luminance_cd_m2);

  /// Luminance is linear from `from` at t0 to `to` at t1 > t0, where t0 and `from` are the end of the last
  /// span of the pixel. Appends its events in (t0, t1] in order of time, with t, x, y, on and cause.
  /// Different pixels may be advanced at the same time by different threads.
  void advance(std::size_t pixel, TimeNs t0, TimeNs t1, float from, float to, std::vector<SimEvent>& events) {
    Pixel& p = pixels_[pixel];
    if (!band_limited_) {
      const float level = to + dark_;
      if (level < p.high && level > p.low && t1 < p.wake) return;
      advance_unfiltered(pixel, {t0, t1, from, to}, events);
    } else if (!advance_without_event(p, t0, t1, from, to)) {
      advance_filtered(pixel, {t0, t1, from, to}, events);
    }
  }

 private:
  /// A cache line. "Signal" is filtered log luminance plus leak * time.
  struct alignas(64) Pixel {
    // No event before `wake` while the luminance with dark current (without a low pass) or the filtered log
    // luminance (with it) stays between these bounds. In reset they are infinite and `wake` is its end.
    float low = 0, high = 0;
    TimeNs wake = 0;
    double filtered = 0;    ///< log luminance after the low pass
    double reference = 0;   ///< signal
    float log_last = 0;     ///< log luminance before the low pass
    float log_leak = 0;     ///< an on event below this filtered log luminance is a leak event
    float on = 0, off = 0;  ///< thresholds
    TimeNs next_noise = 0;
    Random random;
  };
  struct Span {
    TimeNs t0, t1;
    double from, to;  ///< cd/m^2
  };
  class LinearLuminance;
  class LowPassResponse;

  double time_constant_s(double level) const { return tau_fast_s_ + tau_dim_s_ / level; }
  /// Advances the pixel and returns true if the span triggers no event.
  bool advance_without_event(Pixel& p, TimeNs t0, TimeNs t1, float from, float to) const {
    const float level = to + dark_;
    const float log_next = std::log(level);
    const float change = log_next - p.log_last;
    // Log luminance as linear and one time constant are good enough over small changes only.
    if (!(std::abs(change) < kSmallChange) || t1 >= p.wake) return false;
    // The span over the time constant, and the inverse, with one division.
    const double mean = 0.5 * (from + to) + dark_;
    const double span = 1e-9 * static_cast<double>(t1 - t0) * mean;
    const double tau = tau_fast_s_ * mean + tau_dim_s_;
    const double inverse = 1 / (span * tau);
    const double x = span * span * inverse;
    if (!(x > kShortest)) return false;
    // Response of the low pass to a step after the span.
    const double followed = x > 18     ? 1
                            : x < 0.05 ? x * (1 - x * (1.0 / 2 - x * (1.0 / 6 - x * (1.0 / 24))))
                                       : 1 - static_cast<double>(std::exp(static_cast<float>(-x)));
    const double behind = p.log_last - p.filtered;
    const double behind_next = behind + (change * tau * tau * inverse - behind) * followed;
    const double next = log_next - behind_next;
    if (!(next < p.high && next > p.low)) return false;
    // The filtered signal turns where it meets the log luminance.
    if ((behind < 0) != (behind_next < 0) &&
        (std::max(p.log_last, log_next) >= p.high || std::min(p.log_last, log_next) <= p.low))
      return false;
    p.filtered = next;
    p.log_last = log_next;
    return true;
  }
  void advance_unfiltered(std::size_t pixel, const Span& span, std::vector<SimEvent>& events);
  void advance_filtered(std::size_t pixel, const Span& span, std::vector<SimEvent>& events);
  template <class Signal>
  void emit_events(std::size_t pixel, TimeNs t0, TimeNs t1, const Signal& signal,
                   std::vector<SimEvent>& events);
  void fire(std::size_t pixel, TimeNs t, bool on, EventCause cause, std::vector<SimEvent>& events) const;
  void set_reference(Pixel& p, double log_luminance, TimeNs t) const;
  void set_bounds(Pixel& p, TimeNs t) const;
  double hot_rate_hz(std::size_t pixel) const;
  void draw_next_noise(std::size_t pixel, TimeNs t);
  /// Thins the noise process: whether a candidate is an event at this luminance, and of which cause.
  bool accept_noise(std::size_t pixel, double level, EventCause& cause);

  static constexpr float kSmallChange = 0.1F;
  static constexpr double kShortest = 1e-9;  ///< span over time constant

  ImageSize size_;
  EventCameraConfig config_;
  std::uint64_t seed_;
  bool band_limited_;
  float dark_;
  double tau_fast_s_ = 0, tau_dim_s_ = 0;  ///< time constant = fast + dim / luminance
  double leak_per_s_;
  TimeNs refractory_ns_;
  std::vector<Pixel> pixels_;
};

}  // namespace evpose::sim
