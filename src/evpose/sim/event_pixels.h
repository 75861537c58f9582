// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/event/event.h"
#include "evpose/sim/random.h"

namespace evpose {
class ThreadPool;
}

namespace evpose::sim {

struct EventPixelConfig {
  double threshold = 0.25;         ///< change of log intensity that makes an event
  double threshold_spread = 0.03;  ///< 1 sigma over the pixels, on and off drawn apart
  double refractory_s = 100e-6;    ///< after an event the pixel is held in reset for so long
  double stray_light = 0.03;       ///< radiance added to every pixel: the darkest that it can tell apart
  double shot_noise_hz = 0.3;      ///< events per pixel and second without cause
  double hot_share = 12.0 / (640 * 480);     ///< of the pixels,
  double hot_min_hz = 20, hot_max_hz = 600;  ///< ... that fire without cause so often
  double start_spread = 1;  ///< first references stand off the signal by up to this share of the threshold
};

/// The pixels of an event camera. Each compares its intensity with that of its last reset and fires when the
/// ratio has passed its threshold; a reset takes the refractory time and ends at the intensity of its end.
class EventPixels {
 public:
  EventPixels(ImageSize size, const EventPixelConfig& config, std::uint64_t seed);

  /// First picture. `radiance`: one value per pixel, row by row.
  void start(TimeNs t, const std::vector<float>& radiance);

  /// Next picture, at a later time. Between two pictures intensity changes linearly: that is what a pixel
  /// that integrates its area sees of a passing edge. Appends the events since the last picture to `packet`,
  /// whose base is set to the last picture's time, in order of time and then of pixel. Stamps are whole
  /// microseconds, rounded down.
  void advance(TimeNs t, const std::vector<float>& radiance, ThreadPool& pool, EventPacket& packet);

 private:
  struct Pixel {
    float reference = 0;    ///< intensity at the last reset
    float on = 0, off = 0;  ///< ratios to the reference that fire
    float noise_rate_hz = 0;
    double ready_s = -1;  ///< end of a reset that goes on, else -1
    double next_noise_s = 0;
    Random random;
  };
  struct Span {
    double t0_s, t1_s;  ///< since start
    double from, to;    ///< intensities
  };
  /// Calls fire(time_s, on) for each event of one pixel in the span.
  template <class Fire>
  void advance_pixel(Pixel& pixel, const Span& span, const Fire& fire) const;

  ImageSize size_;
  EventPixelConfig config_;
  std::vector<Pixel> pixels_;
  std::vector<float> intensity_;  ///< of the last picture, stray light included
  TimeNs start_ = 0, last_ = 0;
  std::vector<std::vector<Event>> by_chunk_;
};

}  // namespace evpose::sim
