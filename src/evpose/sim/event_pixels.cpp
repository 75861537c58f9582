// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/event_pixels.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "evpose/core/error.h"
#include "evpose/core/parallel.h"

namespace evpose::sim {
namespace {

constexpr std::size_t kChunk = 4096;  // pixels
// A threshold of a few per cent would fire on rounding.
constexpr double kLeastThreshold = 0.05;

}  // namespace

EventPixels::EventPixels(ImageSize size, const EventPixelConfig& config, std::uint64_t seed)
    : size_(size), config_(config), pixels_(static_cast<std::size_t>(size.width) * size.height) {
  for (std::size_t i = 0; i < pixels_.size(); ++i) {
    Pixel& pixel = pixels_[i];
    pixel.random = Random(seed, i);
    const auto threshold = [&] {
      return std::max(kLeastThreshold, config.threshold + config.threshold_spread * pixel.random.normal());
    };
    pixel.on = static_cast<float>(std::exp(threshold()));
    pixel.off = static_cast<float>(std::exp(-threshold()));
    const bool hot = pixel.random.uniform() < config.hot_share;
    const double octaves = std::log(config.hot_max_hz / config.hot_min_hz);
    const double hot_hz = config.hot_min_hz * std::exp(octaves * pixel.random.uniform());
    pixel.noise_rate_hz = static_cast<float>(hot ? hot_hz : config.shot_noise_hz);
  }
}

void EventPixels::start(TimeNs t, const std::vector<float>& radiance) {
  EVPOSE_CHECK(radiance.size() == pixels_.size());
  start_ = last_ = t;
  intensity_.resize(radiance.size());
  for (std::size_t i = 0; i < pixels_.size(); ++i) {
    Pixel& pixel = pixels_[i];
    intensity_[i] = static_cast<float>(radiance[i] + config_.stray_light);
    // Anywhere between "about to fire off" and "about to fire on".
    const double share = config_.start_spread * pixel.random.uniform(-1, 1);
    pixel.reference =
        intensity_[i] * static_cast<float>(std::pow(share < 0 ? pixel.on : pixel.off, std::abs(share)));
    pixel.ready_s = -1;
    pixel.next_noise_s = pixel.noise_rate_hz > 0 ? pixel.random.exponential() / pixel.noise_rate_hz
                                                 : std::numeric_limits<double>::infinity();
  }
}

template <class Fire>
void EventPixels::advance_pixel(Pixel& pixel, const Span& span, const Fire& fire) const {
  const double slope = (span.to - span.from) / (span.t1_s - span.t0_s);
  const auto intensity = [&](double t_s) { return span.from + slope * (t_s - span.t0_s); };
  double now = span.t0_s;
  while (true) {
    if (pixel.ready_s >= now) {  // in reset: the reference follows the signal until its end
      if (pixel.ready_s > span.t1_s) return;
      now = pixel.ready_s;
      pixel.reference = static_cast<float>(intensity(now));
      pixel.ready_s = -1;
    }
    const bool rising = span.to > span.from;
    const double level = static_cast<double>(pixel.reference) * (rising ? pixel.on : pixel.off);
    const bool crosses = rising ? span.to >= level : span.to <= level && span.to < span.from;
    const double crossing = crosses ? std::max(now, span.t0_s + (level - span.from) / slope)
                                    : std::numeric_limits<double>::infinity();
    // Noise that fell into a reset is lost.
    while (pixel.next_noise_s < now) pixel.next_noise_s += pixel.random.exponential() / pixel.noise_rate_hz;
    const bool noise = pixel.next_noise_s < crossing;
    const double t = noise ? pixel.next_noise_s : crossing;
    if (!(t <= span.t1_s)) return;
    fire(t, noise ? (pixel.random.bits() & 1) != 0 : rising);
    now = t;
    pixel.reference = static_cast<float>(noise ? intensity(t) : level);
    if (noise) pixel.next_noise_s = t + pixel.random.exponential() / pixel.noise_rate_hz;
    if (config_.refractory_s > 0) pixel.ready_s = t + config_.refractory_s;
  }
}

void EventPixels::advance(TimeNs t, const std::vector<float>& radiance, ThreadPool& pool,
                          EventPacket& packet) {
  EVPOSE_CHECK(radiance.size() == pixels_.size() && t > last_);
  const double t0_s = to_seconds(last_ - start_), t1_s = to_seconds(t - start_);
  packet.base = last_ / kNsPerUs * kNsPerUs;
  by_chunk_.resize(ThreadPool::chunks(pixels_.size(), kChunk));
  pool.for_chunks(pixels_.size(), kChunk, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    std::vector<Event>& events = by_chunk_[chunk];
    events.clear();
    for (std::size_t i = begin; i < end; ++i) {
      const float to = static_cast<float>(radiance[i] + config_.stray_light);
      Pixel& pixel = pixels_[i];
      // Most pixels do nothing between two pictures: one look at the end tells.
      const bool quiet = to < pixel.reference * pixel.on && to > pixel.reference * pixel.off &&
                         pixel.next_noise_s > t1_s && pixel.ready_s < t0_s;
      if (!quiet) {
        const int x = static_cast<int>(i % size_.width), y = static_cast<int>(i / size_.width);
        advance_pixel(pixel, {t0_s, t1_s, intensity_[i], to}, [&](double t_s, bool on) {
          const TimeNs stamp = start_ + static_cast<TimeNs>(t_s * 1e9);
          const TimeNs dt_us = std::max<TimeNs>(0, stamp - packet.base) / kNsPerUs;
          events.push_back(make_event(static_cast<std::uint32_t>(dt_us), x, y, on));
        });
      }
      intensity_[i] = to;
    }
  });
  for (const std::vector<Event>& events : by_chunk_)
    packet.events.insert(packet.events.end(), events.begin(), events.end());
  std::stable_sort(packet.events.begin(), packet.events.end(),
                   [](const Event& a, const Event& b) { return a.dt_us < b.dt_us; });
  last_ = t;
}

}  // namespace evpose::sim
