// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/sim/sensors/sim_event.h"
#include "evpose/sim/world/random.h"

namespace evpose {
class ConfigTable;
}

namespace evpose::sim {

/// The pixels of an event camera.
struct EventCameraConfig {
  double threshold_on = 0.25;                ///< rise of log luminance that makes an event
  double threshold_off = 0.25;               ///< fall of log luminance that makes an event
  double threshold_sigma = 0.03;             ///< over the pixels, on and off drawn apart
  double refractory_us = 100;                ///< after an event the pixel is held in reset for so long
  double dark_cd_m2 = 0.05;                  ///< dark current, as luminance added to every pixel
  double bandwidth_hz_per_cd_m2 = 100;       ///< corner of the photoreceptor's low pass; 0: no limit at all
  double bandwidth_max_hz = 3000;            ///< which it nears in bright light: the two time constants add
  double leak_hz = 0.1;                      ///< events per pixel and second that the reference's drift makes
  double shot_noise_dark_hz = 0.9;           ///< events per pixel and second without cause: in darkness
  double shot_noise_bright_hz = 0.14;        ///< in bright light
  double shot_noise_half_cd_m2 = 5;          ///< luminance where the rate is half-way between the two
  double hot_share = 4e-5;                   ///< of the pixels that fire without cause
  double hot_min_hz = 20, hot_max_hz = 600;  ///< how often; rates spread evenly over the octaves
  double start_spread = 1;  ///< first references are off the signal by up to this share of the threshold
};
void describe(ConfigTable& table, EventCameraConfig& config);

/// Each pixel follows the logarithm of its luminance, which a low pass may slow, compares it with what it was
/// at the last reset and fires when the change has passed its threshold. A reset takes the refractory time
/// and ends at the signal of its end. The reference leaks downwards, shot noise and hot pixels fire without
/// cause.
///
/// A pixel depends on nothing but its own light, its number and the seed, and only little on how a course of
/// luminance is cut in spans: not at all without a low pass; with it log luminance is taken as linear over
/// changes of up to a tenth.
class EventPixels {
 public:
  EventPixels(ImageSize size, const EventCameraConfig& config, std::uint64_t seed);

  /// First sight of a pixel.
  void start(std::size_t pixel, TimeNs t, float luminance_cd_m2);

  /// Luminance goes linearly from `from` at t0 to `to` at t1 > t0, where t0 and `from` are the end of the
  /// pixel's last span. Appends its events in (t0, t1] in order of time, with t, x, y, on and cause.
  /// Different pixels may be advanced at the same time by different threads.
  void advance(std::size_t pixel, TimeNs t0, TimeNs t1, float from, float to, std::vector<SimEvent>& events) {
    Pixel& p = pixels_[pixel];
    if (!limited_) {
      const float level = to + dark_;
      if (level < p.high && level > p.low && t1 < p.wake) return;
      advance_unlimited(pixel, {t0, t1, from, to}, events);
    } else if (!advance_quietly(p, t0, t1, from, to)) {
      advance_limited(pixel, {t0, t1, from, to}, events);
    }
  }

 private:
  /// A cache line. "Signal" is log luminance as filtered, plus leak * time.
  struct alignas(64) Pixel {
    // Nothing happens before `wake` while the luminance with dark current (without a low pass) or the
    // filtered log luminance (with it) stays between these. A pixel in reset has infinite ones and wakes at
    // its end.
    float low = 0, high = 0;
    TimeNs wake = 0;
    double filtered = 0;   ///< log luminance behind the low pass
    double reference = 0;  ///< signal
    float log_last = 0;    ///< log luminance in front of the low pass
    float log_leak =
        0;  ///< filtered log luminance below which an on event is more the leak's than the signal's
    float on = 0, off = 0;  ///< thresholds
    TimeNs next_noise = 0;
    Random random;
  };
  struct Span {
    TimeNs t0, t1;
    double from, to;  ///< cd/m^2
  };
  class Ramp;
  class Response;

  double time_constant_s(double level) const { return tau_fast_s_ + tau_dim_s_ / level; }
  /// True if that is all that happens.
  bool advance_quietly(Pixel& p, TimeNs t0, TimeNs t1, float from, float to) const {
    const float level = to + dark_;
    const float log_next = std::log(level);
    const float change = log_next - p.log_last;
    // Log luminance as linear and one time constant are good enough over small changes only.
    if (!(std::abs(change) < kSmallChange) || t1 >= p.wake) return false;
    // Spans as time constants, and time constants as spans, with one division.
    const double mean = 0.5 * (from + to) + dark_;
    const double span = 1e-9 * static_cast<double>(t1 - t0) * mean;
    const double tau = tau_fast_s_ * mean + tau_dim_s_;
    const double inverse = 1 / (span * tau);
    const double x = span * span * inverse;
    if (!(x > kShortest)) return false;
    // The share of a step that the low pass follows.
    const double followed = x > 18     ? 1
                            : x < 0.05 ? x * (1 - x * (1.0 / 2 - x * (1.0 / 6 - x * (1.0 / 24))))
                                       : 1 - static_cast<double>(std::exp(static_cast<float>(-x)));
    const double behind = p.log_last - p.filtered;
    const double behind_next = behind + (change * tau * tau * inverse - behind) * followed;
    const double next = log_next - behind_next;
    if (!(next < p.high && next > p.low)) return false;
    // Where it turns it meets the log luminance.
    if ((behind < 0) != (behind_next < 0) &&
        (std::max(p.log_last, log_next) >= p.high || std::min(p.log_last, log_next) <= p.low))
      return false;
    p.filtered = next;
    p.log_last = log_next;
    return true;
  }
  void advance_unlimited(std::size_t pixel, const Span& span, std::vector<SimEvent>& events);
  void advance_limited(std::size_t pixel, const Span& span, std::vector<SimEvent>& events);
  template <class Signal>
  void walk(std::size_t pixel, TimeNs t0, TimeNs t1, const Signal& signal, std::vector<SimEvent>& events);
  void fire(std::size_t pixel, TimeNs t, bool on, EventCause cause, std::vector<SimEvent>& events) const;
  void set_reference(Pixel& p, double log_luminance, TimeNs t) const;
  void set_bounds(Pixel& p, TimeNs t) const;
  double hot_rate_hz(std::size_t pixel) const;
  void draw_next_noise(std::size_t pixel, TimeNs t);
  /// Whether a candidate is noise at this luminance, and of which cause.
  bool accept_noise(std::size_t pixel, double level, EventCause& cause);

  static constexpr float kSmallChange = 0.1F;
  static constexpr double kShortest = 1e-9;  ///< span over time constant

  ImageSize size_;
  EventCameraConfig config_;
  std::uint64_t seed_;
  bool limited_;
  float dark_;
  double tau_fast_s_ = 0, tau_dim_s_ = 0;  ///< time constant = fast + dim / luminance
  double leak_per_s_;
  TimeNs refractory_ns_;
  std::vector<Pixel> pixels_;
};

}  // namespace evpose::sim
