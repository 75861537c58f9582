// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/sim/sensors/sim_event.h"
#include "evpose/sim/world/lanes.h"
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
  /// `gain`: fraction of the light that reaches each pixel; empty: all.
  EventPixels(ImageSize size, const EventCameraConfig& config, std::uint64_t seed,
              std::vector<float> gain = {});

  /// Initializes a pixel with its first luminance.
  void start(std::size_t pixel, TimeNs t, float luminance_cd_m2);

  /// Luminance is linear from `from` at t0 to `to` at t1 > t0, where t0 and `from` are the end of the last
  /// span of the pixel. Appends its events in (t0, t1] in order of time, with t, x, y, on and cause.
  /// Different pixels may be advanced at the same time by different threads.
  void advance(std::size_t pixel, TimeNs t0, TimeNs t1, float from, float to, std::vector<SimEvent>& events) {
    from *= gain_[pixel];
    to *= gain_[pixel];
    Quiet<float> next{from, to, low_[pixel], high_[pixel], log_last_[pixel], filtered_[pixel]};
    if (t1 < wake_[pixel] && stays_quiet(t1 - t0, next)) {
      log_last_[pixel] = next.log_last;
      filtered_[pixel] = next.filtered;
    } else if (band_limited_) {
      advance_filtered(pixel, {t0, t1, from, to}, events);
    } else {
      advance_unfiltered(pixel, {t0, t1, from, to}, events);
    }
  }

  /// The same for those of kLanes pixels, from `first` on, that are `wanted` and trigger no event; returns
  /// them, a bit for each. Nothing happens to the others.
  unsigned advance_quiet(std::size_t first, TimeNs t0, TimeNs t1, FloatLanes from, FloatLanes to,
                         IntLanes wanted) {
    const FloatLanes gain = load(&gain_[first]);
    Quiet<FloatLanes> next{from * gain,
                           to * gain,
                           load(&low_[first]),
                           load(&high_[first]),
                           load(&log_last_[first]),
                           load(&filtered_[first])};
    const FloatLanes log_last = next.log_last, filtered = next.filtered;
    IntLanes quiet;
    for (int i = 0; i < kLanes; ++i) quiet[i] = t1 < wake_[first + i] ? -1 : 0;
    quiet &= wanted;
    quiet &= stays_quiet(t1 - t0, next);
    store(&log_last_[first], select(quiet, next.log_last, log_last));
    store(&filtered_[first], select(quiet, next.filtered, filtered));
    return bits_of(quiet);
  }

 private:
  /// What seldom changes. "Signal" is filtered log luminance plus leak * time.
  struct Pixel {
    double reference = 0;   ///< signal
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
  /// State of one pixel or of eight.
  template <class V>
  struct Quiet {
    V from, to;  ///< cd/m^2
    V low, high, log_last, filtered;
  };
  /// Whether a span triggers no event, for pixels that do not wake in it; sets the state at its end.
  template <class V>
  typename LaneTypes<V>::Mask stays_quiet(TimeNs length, Quiet<V>& p) const {
    const V level = p.to + dark_;
    if (!band_limited_) return (level < p.high) & (level > p.low);
    const V log_next = fast_log(level);
    const V change = log_next - p.log_last;
    const V mean = 0.5F * (p.from + p.to) + dark_;
    const V x = static_cast<float>(1e-9 * static_cast<double>(length)) * mean /
                (static_cast<float>(tau_fast_s_) * mean + static_cast<float>(tau_dim_s_));
    // Response of the low pass to a step after the span, whose length is x time constants.
    const V series = x * (1.0F - x * (1.0F / 2 - x * (1.0F / 6 - x * (1.0F / 24))));
    const V decayed = 1.0F - fast_exp(V(-smaller(x, all<V>(40))));
    const V followed = select(x < kSeries, series, decayed);
    const V behind = p.log_last - p.filtered;
    const V behind_next = behind + (change / x - behind) * followed;
    const V next = log_next - behind_next;
    // The filtered signal turns where it meets the log luminance.
    const auto turns = (behind < 0.0F) != (behind_next < 0.0F);
    const auto above = larger(p.log_last, log_next) >= p.high, below = smaller(p.log_last, log_next) <= p.low;
    const auto reaches = above | below;
    // Log luminance as linear and one time constant are good enough over small changes only.
    const auto quiet = (magnitude(change) < kSmallChange) & (x > kShortest) & (next < p.high) &
                       (next > p.low) & !(turns & reaches);
    p.filtered = next;
    p.log_last = log_next;
    return quiet;
  }
  void advance_unfiltered(std::size_t pixel, const Span& span, std::vector<SimEvent>& events);
  void advance_filtered(std::size_t pixel, const Span& span, std::vector<SimEvent>& events);
  template <class Signal>
  void emit_events(std::size_t pixel, TimeNs t0, TimeNs t1, const Signal& signal,
                   std::vector<SimEvent>& events);
  void fire(std::size_t pixel, TimeNs t, bool on, EventCause cause, std::vector<SimEvent>& events) const;
  void set_reference(Pixel& p, double log_luminance, TimeNs t) const;
  void set_bounds(std::size_t pixel, TimeNs t);
  double hot_rate_hz(std::size_t pixel) const;
  void draw_next_noise(std::size_t pixel, TimeNs t);
  /// Thins the noise process: whether a candidate is an event at this luminance, and of which cause.
  bool accept_noise(std::size_t pixel, double level, EventCause& cause);

  static constexpr float kSmallChange = 0.1F;
  static constexpr float kShortest = 1e-9F;  ///< span over time constant
  static constexpr float kSeries = 0.06F;    ///< below, a series is more precise than an exponential

  ImageSize size_;
  EventCameraConfig config_;
  std::uint64_t seed_;
  bool band_limited_;
  float dark_;
  double tau_fast_s_ = 0, tau_dim_s_ = 0;  ///< time constant = fast + dim / luminance
  double leak_per_s_;
  TimeNs refractory_ns_;
  // No event before `wake` while the luminance with dark current (without a low pass) or the filtered log
  // luminance (with it) stays between `low` and `high`. In reset they are infinite and `wake` is its end.
  std::vector<float> low_, high_;
  std::vector<float> filtered_;  ///< log luminance after the low pass
  std::vector<float> log_last_;  ///< log luminance before it
  std::vector<TimeNs> wake_;
  std::vector<float> gain_;
  std::vector<Pixel> pixels_;
};

}  // namespace evpose::sim
