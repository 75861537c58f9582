// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/event/event_preprocessor.h"

#include <algorithm>

#include "evpose/core/config.h"

namespace evpose {
namespace {
constexpr double kAllowed_us = 5000;  // of the limit's rate may come at once
constexpr std::size_t kAhead = 16;    // events; as long as memory takes to answer
}  // namespace

void describe(ConfigTable& table, EventPreprocessorConfig& c) {
  table.group("noise_filter", c.noise);
  table.add("most_mev_s", c.most_mev_s, "Mev/s", "events are shed beyond this rate; 0: never", {0, 1e5});
}

EventPreprocessor::EventPreprocessor(int width, int height, const EventPreprocessorConfig& config)
    : config_(config), width_(width), height_(height), noise_filter_(width, height, config.noise) {}

void EventPreprocessor::set_motion(double flow_px_per_s) { noise_filter_.set_motion(flow_px_per_s); }

void EventPreprocessor::keep_surface(bool on) {
  if (!on) return surface_.reset();
  if (!surface_) surface_.emplace(width_, height_);
}

void EventPreprocessor::rebase(std::uint32_t shift_us) {
  noise_filter_.rebase(shift_us);
  if (surface_) surface_->rebase(shift_us);
  refilled_us_ = refilled_us_ > shift_us ? refilled_us_ - shift_us : 0;
  for (FilteredEvent& e : kept_) e.stamp_us = e.stamp_us > shift_us ? e.stamp_us - shift_us : 1;
}

void EventPreprocessor::take(const EventPacket& packet, std::span<const Event> events) {
  if (events.empty()) return;
  std::int64_t base_us = clock_.microseconds(packet.time(events.front())) - events.front().dt_us;
  for (std::size_t i = 0; i < events.size(); ++i) {
    if (i + kAhead < events.size()) {
      const Event& later = events[i + kAhead];
      if (later.x < width_ && later.y < height_) noise_filter_.prefetch(later.x, later.y);
    }
    const Event& e = events[i];
    ++counts_.read;
    if (e.x >= width_ || e.y >= height_) {
      ++counts_.outside;
      continue;
    }
    if (base_us + e.dt_us > StampClock::kLargest) {
      clock_.stamp(packet.time(e), [this](std::uint32_t shift) { rebase(shift); });
      base_us = clock_.microseconds(packet.time(e)) - e.dt_us;
    }
    const auto stamp = static_cast<std::uint32_t>(std::max<std::int64_t>(base_us + e.dt_us, 1));
    if (config_.most_mev_s > 0 && shed(e, stamp)) {
      ++counts_.shed;
      continue;
    }
    if (!noise_filter_.keep(e.x, e.y, stamp)) continue;
    ++counts_.kept;
    kept_.push_back({stamp, e.x, e.y, e.on});
    if (surface_) surface_->insert(e.x, e.y, e.on ? Polarity::on : Polarity::off, stamp);
  }
}

/// The fuller the last milliseconds were, the fewer events pass: which of them is by chance, so that no part
/// of the image or of a burst is preferred, but always the same for the same event.
bool EventPreprocessor::shed(const Event& e, std::uint32_t stamp_us) {
  const double full = kAllowed_us * config_.most_mev_s;
  if (refilled_us_ == 0) allowance_ = full;
  if (stamp_us > refilled_us_) {
    allowance_ = std::min(full, allowance_ + config_.most_mev_s * (stamp_us - refilled_us_));
    refilled_us_ = stamp_us;
  }
  if (allowance_ < 0.5 * full) {
    std::uint32_t h = (stamp_us * 0x9E3779B1u) ^ (e.x * 0x85EBCA77u) ^ (e.y * 0xC2B2AE3Du);
    h = (h ^ (h >> 15)) * 0x2C1B3C6Du;
    h ^= h >> 13;
    if (h > allowance_ / (0.5 * full) * 4294967295.0) return true;
  }
  allowance_ -= 1;
  return false;
}

}  // namespace evpose
