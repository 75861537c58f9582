// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/event/event_preprocessor.h"

#include <algorithm>
#include <array>

#include "evpose/core/config.h"

namespace evpose {
namespace {
constexpr double kAllowed_us = 5000;  // of the limit's rate may come at once
constexpr std::size_t kAhead = 16;    // events; as long as memory takes to answer
constexpr std::size_t kBlock = 256;   // events that are looked at together, within the first cache

FilteredEvent stamped(const Event& e, std::int64_t base_us) {
  return {static_cast<std::uint32_t>(std::max<std::int64_t>(base_us + e.dt_us, 1)), e.x, e.y, e.on};
}

}  // namespace

void describe(ConfigTable& table, EventPreprocessorConfig& c) {
  table.group("noise_filter", c.noise);
  table.add("most_mev_s", c.most_mev_s, "Mev/s", "events that matter are shed beyond this rate; 0: never",
            {0, 1e5});
}

EventPreprocessor::EventPreprocessor(int width, int height, const EventPreprocessorConfig& config)
    : config_(config), width_(width), height_(height), noise_filter_(width, height, config.noise) {}

void EventPreprocessor::set_motion(double flow_px_per_s) { noise_filter_.set_motion(flow_px_per_s); }

void EventPreprocessor::keep_surface(bool on) {
  drawing_ = on;
  if (on && !surface_) surface_.emplace(width_, height_);
}

void EventPreprocessor::rebase(std::uint32_t shift_us) {
  noise_filter_.rebase(shift_us);
  if (surface_) surface_->rebase(shift_us);
  refilled_us_ = refilled_us_ > shift_us ? refilled_us_ - shift_us : 0;
  if (collected_ != nullptr)
    for (FilteredEvent& e : *collected_) e.stamp_us = e.stamp_us > shift_us ? e.stamp_us - shift_us : 1;
  for (FilteredEvent& e : kept_) e.stamp_us = e.stamp_us > shift_us ? e.stamp_us - shift_us : 1;
}

/// Of the packet, on a clock that holds all of the events.
std::int64_t EventPreprocessor::base_us(const EventPacket& packet, std::span<const Event> events) {
  clock_.microseconds(packet.time(events.front()));  // where it starts
  clock_.stamp(packet.time(events.back()), [this](std::uint32_t shift) { rebase(shift); });
  return clock_.microseconds(packet.time(events.front())) - events.front().dt_us;
}

void EventPreprocessor::take(const EventPacket& packet, std::span<const Event> events) {
  if (events.empty()) return;
  const std::int64_t base = base_us(packet, events);
  const std::size_t before = kept_.size();
  if (collected_ != nullptr)
    for (const Event& e : events)
      if (e.x < width_ && e.y < height_ && (collected_where_ == nullptr || collected_where_->holds(e.x, e.y)))
        collected_->push_back(stamped(e, base));
  counts_.read += static_cast<std::int64_t>(events.size());
  if (interest_ != nullptr)
    take_where(events, base, [this](const Event& e) { return interest_->holds(e.x, e.y); });
  else
    take_where(events, base, [](const Event&) { return true; });
  counts_.kept += static_cast<std::int64_t>(kept_.size() - before);
  if (!drawing_) return;
  if (interest_ != nullptr) return draw(events, base);
  for (std::size_t i = before; i < kept_.size(); ++i)
    surface_->insert(kept_[i].x, kept_[i].y, kept_[i].on ? Polarity::on : Polarity::off, kept_[i].stamp_us);
}

/// Most events matter nowhere: each is written in any case and kept by counting, as a branch would be guessed
/// wrong.
template <class Matters>
void EventPreprocessor::take_where(std::span<const Event> events, std::int64_t base_us,
                                   const Matters& matters) {
  std::array<std::uint16_t, kBlock> which;
  std::array<FilteredEvent, kBlock> block;
  for (std::size_t begin = 0; begin < events.size(); begin += kBlock) {
    const std::span<const Event> some = events.subspan(begin, std::min(kBlock, events.size() - begin));
    std::size_t count = 0, inside = 0;
    for (std::size_t i = 0; i < some.size(); ++i) {
      const auto in_image =
          static_cast<std::size_t>(some[i].x < width_) & static_cast<std::size_t>(some[i].y < height_);
      which[count] = static_cast<std::uint16_t>(i);
      count += in_image & static_cast<std::size_t>(matters(some[i]));
      inside += in_image;
    }
    counts_.outside += static_cast<std::int64_t>(some.size() - inside);
    counts_.near += static_cast<std::int64_t>(count);
    for (std::size_t k = 0; k < count; ++k) block[k] = stamped(some[which[k]], base_us);
    filter({block.data(), count});
  }
}

/// Hands on what passes the limit of the rate and the noise filter.
void EventPreprocessor::filter(std::span<const FilteredEvent> events) {
  for (std::size_t i = 0; i < events.size(); ++i) {
    if (i + kAhead < events.size()) noise_filter_.prefetch(events[i + kAhead].x, events[i + kAhead].y);
    const FilteredEvent& e = events[i];
    if (!shed(e) && noise_filter_.keep(e.x, e.y, e.stamp_us)) kept_.push_back(e);
  }
}

void EventPreprocessor::draw(std::span<const Event> events, std::int64_t base_us) {
  for (const Event& event : events) {
    const FilteredEvent e = stamped(event, base_us);
    if (e.x < width_ && e.y < height_)
      surface_->insert(e.x, e.y, e.on ? Polarity::on : Polarity::off, e.stamp_us);
  }
}

/// The fuller the last milliseconds were, the fewer events pass: which of them is by chance, so that no part
/// of the image or of a burst is preferred, but always the same for the same event.
bool EventPreprocessor::shed(const FilteredEvent& e) {
  if (!(config_.most_mev_s > 0)) return false;
  const double full = kAllowed_us * config_.most_mev_s;
  if (refilled_us_ == 0) allowance_ = full;
  if (e.stamp_us > refilled_us_) {
    allowance_ = std::min(full, allowance_ + config_.most_mev_s * (e.stamp_us - refilled_us_));
    refilled_us_ = e.stamp_us;
  }
  if (allowance_ < 0.5 * full) {
    std::uint32_t h = (e.stamp_us * 0x9E3779B1u) ^ (e.x * 0x85EBCA77u) ^ (e.y * 0xC2B2AE3Du);
    h = (h ^ (h >> 15)) * 0x2C1B3C6Du;
    h ^= h >> 13;
    if (h > allowance_ / (0.5 * full) * 4294967295.0) {
      ++counts_.shed;
      return true;
    }
  }
  allowance_ -= 1;
  return false;
}

}  // namespace evpose
