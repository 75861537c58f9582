// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/events/event_packer.h"

#include <algorithm>
#include <cmath>

namespace evpose {
namespace {

constexpr std::size_t kMostEvents = 1 << 20;
/// More events at one microsecond than any sensor has pixels.
constexpr std::size_t kMostAtOnce = 8 << 20;
constexpr unsigned kMinusAndZero = 0b011;
/// Events checked in one go, before looking at the outcome.
constexpr std::size_t kStride = 256;

std::int64_t floor_divide(std::int64_t a, std::int64_t b) { return a / b - (a % b < 0 ? 1 : 0); }
std::int64_t ceil_divide(std::int64_t a, std::int64_t b) { return -floor_divide(-a, b); }

std::int64_t column(std::uint64_t bits) { return static_cast<std::int64_t>(bits >> 32 & 0xFFFF); }
std::int64_t row(std::uint64_t bits) { return static_cast<std::int64_t>(bits >> 48 & 0x7FFF); }
std::int64_t time_of(std::uint64_t bits) { return static_cast<std::int64_t>(bits & 0xFFFFFFFF); }

/// Negative if one of the events lies outside, or before the event at its left. The sign bit collects what is
/// wrong, so that the loop has no branch and runs on vectors.
std::int64_t collect_faults(const Event* events, std::size_t begin, std::size_t end, int width, int height) {
  const std::int64_t last_column = width - 1, last_row = height - 1;
  std::int64_t faults = 0;
  for (std::size_t i = begin; i < end; ++i) {
    const auto left = std::bit_cast<std::uint64_t>(events[i - 1]);
    const auto bits = std::bit_cast<std::uint64_t>(events[i]);
    faults |= (last_column - column(bits)) | (last_row - row(bits)) | (time_of(bits) - time_of(left));
  }
  return faults;
}

}  // namespace

Expected<EventPacker> EventPacker::make(std::string path, const EventReadOptions& options, ImageSize size) {
  if (!(options.packet_s >= 1e-6 && options.packet_s <= 100))
    return Error{path, text("packets of ", options.packet_s, " s"), "choose 1e-6 to 100 s"};
  if ((options.flip_x || options.flip_y) && size == ImageSize{})
    return Error{path, "cannot be flipped: its image size is not known",
                 "set events.resolution: [width, height]"};
  if (size.width > 65536 || size.height > 32768)
    return Error{path, text("an image of ", size.width, " x ", size.height, " pixels"),
                 "the largest is 65536 x 32768"};
  EventPacker packer;
  packer.path_ = std::move(path);
  packer.options_ = options;
  packer.size_ = size;
  packer.packet_us_ = std::llround(options.packet_s * 1e6);
  if (options.t_start_ns) packer.first_us_ = ceil_divide(*options.t_start_ns - options.offset_ns, kNsPerUs);
  if (options.t_end_ns) packer.stop_us_ = ceil_divide(*options.t_end_ns - options.offset_ns, kNsPerUs);
  if (size.width > 0) packer.widest_ = size.width;
  if (size.height > 0) packer.highest_ = size.height;
  return packer;
}

Expected<EventPacker> EventPacker::make(std::string path, const EventReadOptions& options, ImageSize size,
                                        Fetch fetch) {
  auto packer = make(std::move(path), options, size);
  if (packer) packer->fetch_raw_ = std::move(fetch);
  return packer;
}

Expected<EventPacker> EventPacker::make(std::string path, const EventReadOptions& options, ImageSize size,
                                        FetchBlock fetch) {
  auto packer = make(std::move(path), options, size);
  if (packer) packer->fetch_block_ = std::move(fetch);
  return packer;
}

Error EventPacker::error(std::size_t i, const std::string& what, const std::string& fix) const {
  if (fetch_raw_ && !raw_.line.empty()) return Error{text(path_, ":", raw_.line[raw_begin_ + i]), what, fix};
  return Error{path_, text("event ", block_.first_row + static_cast<std::int64_t>(i), " (from 0): ", what),
               fix};
}

bool EventPacker::plausible(std::size_t i) {
  const std::int64_t t = raw_.t_us[i];
  const std::int32_t x = raw_.x[i], y = raw_.y[i], p = raw_.p[i];
  if (t > kLargestTimeUs || t < -kLargestTimeUs) return false;
  if (x < 0 || x >= widest_ || y < 0 || y >= highest_ || p < -1 || p > 1) return false;
  polarities_ |= 1u << (p + 1);
  return (polarities_ & kMinusAndZero) != kMinusAndZero;
}

void EventPacker::narrow() {
  raw_begin_ = raw_end_;
  block_.start();
  block_.first_row = raw_.first_row + static_cast<std::int64_t>(raw_begin_);
  block_.base_us = raw_.t_us[raw_begin_];
  std::size_t i = raw_begin_, n = 0;
  for (; i < raw_.size() && n < kBlockEvents; ++i, ++n) {
    raw_fault_ = !plausible(i) || (i > 0 && raw_.t_us[i] < raw_.t_us[i - 1]);
    const std::int64_t dt = raw_.t_us[i] - block_.base_us;
    if (raw_fault_ || dt > UINT32_MAX) break;
    block_.events[n] = make_event(static_cast<std::uint32_t>(dt), raw_.x[i], raw_.y[i], raw_.p[i] == 1);
  }
  block_.count = n;
  raw_end_ = i;
}

std::size_t EventPacker::sound() const {
  const Event* events = block_.events.data();
  const std::size_t n = block_.count;
  if (n == 0 || block_.base_us < -kLargestTimeUs || block_.base_us > kLargestTimeUs - UINT32_MAX ||
      block_.time_us(0) < last_us_)
    return 0;
  // The first has no left neighbour to compare with; its time was held against the last block.
  if (events[0].x >= widest_ || events[0].y >= highest_) return 0;
  const ImageSize vouched = block_.sound_within;
  if (vouched != ImageSize{} && vouched.width <= widest_ && vouched.height <= highest_) return n;
  for (std::size_t begin = 1; begin < n; begin += kStride) {
    const std::size_t end = std::min(begin + kStride, n);
    if (collect_faults(events, begin, end, widest_, highest_) >= 0) continue;
    std::size_t i = begin;
    while (collect_faults(events, i, i + 1, widest_, highest_) >= 0) ++i;
    return i;
  }
  return n;
}

EventPacker::Suspect EventPacker::suspect() const {
  if (fetch_raw_) {
    const std::size_t i = raw_begin_ + sound_;
    return {raw_.t_us[i], raw_.x[i], raw_.y[i], raw_.p[i]};
  }
  const Event& e = block_.events[sound_];
  return {block_.time_us(sound_), e.x, e.y, e.on};
}

Error EventPacker::fault() const {
  const auto [t, x, y, p] = suspect();
  if (t < last_us_)
    return error(sound_, text("the stamp ", t, " us goes back behind ", last_us_, " us: out of order"),
                 "sort the events by time");
  if (t > kLargestTimeUs - UINT32_MAX || t < -kLargestTimeUs)
    return error(sound_, text("the stamp ", t, " us is out of range"), "set events.time_unit, e.g. ns");
  if (x < 0 || x >= widest_ || y < 0 || y >= highest_)
    return error(sound_,
                 text("pixel (", x, ", ", y, ") lies outside of the image of ", widest_, " x ", highest_),
                 "check events.resolution and the calibration's resolution");
  if (p < -1 || p > 1)
    return error(sound_, text("polarity ", p, " is neither 0/1 nor -1/+1"), "correct the file");
  return error(sound_, "the file has both polarities 0 and -1", "store either 0/1 or -1/+1");
}

std::size_t EventPacker::first_at(std::int64_t t_us) const {
  const auto begin = block_.events.begin() + static_cast<std::ptrdiff_t>(position_);
  const auto end = block_.events.begin() + static_cast<std::ptrdiff_t>(sound_);
  const auto it =
      std::partition_point(begin, end, [&](const Event& e) { return block_.base_us + e.dt_us < t_us; });
  return static_cast<std::size_t>(it - block_.events.begin());
}

/// Where the packet ends in the block, were there no next one: at the window's end, or when it is full, but
/// not between equal stamps.
std::size_t EventPacker::end_of_packet(const EventPacket& packet) const {
  const std::size_t end = first_at(std::min(window_end_us_, stop_us_));
  const std::size_t held = packet.events.size();
  std::size_t full = position_ + (held < kMostEvents ? kMostEvents - held : 0);
  while (full < end && block_.time_us(full) == (full > 0 ? block_.time_us(full - 1) : last_us_)) ++full;
  return std::min(full, end);
}

void EventPacker::append(EventPacket& packet, std::size_t end) {
  Event* const events = block_.events.data();
  last_us_ = block_.time_us(end - 1);
  const auto shift = static_cast<std::uint32_t>(block_.base_us - base_us_);
  const bool flip = options_.flip_x || options_.flip_y || options_.swap_polarity;
  packet.events.insert(packet.events.end(), events + position_, events + end);
  Event* const out = packet.events.data() + (packet.events.size() - (end - position_));
  const std::size_t count = end - position_;
  for (std::size_t i = 0; i < count; ++i) out[i].dt_us += shift;
  for (std::size_t i = 0; flip && i < count; ++i) {
    const int x = options_.flip_x ? size_.width - 1 - out[i].x : out[i].x;
    const int y = options_.flip_y ? size_.height - 1 - out[i].y : out[i].y;
    out[i] = make_event(out[i].dt_us, x, y, (out[i].on != 0) != options_.swap_polarity);
  }
  position_ = end;
}

Expected<bool> EventPacker::take(EventPacket& packet) {
  if (packet.empty() && position_ < sound_) {
    const std::size_t first = first_at(first_us_);
    if (first > position_) last_us_ = block_.time_us(first - 1);
    position_ = first;
  }
  if (position_ < sound_) {
    const std::int64_t t = block_.time_us(position_);
    if (packet.empty()) {
      if (t >= stop_us_) {
        done_ = true;
        return true;
      }
      base_us_ = t;
      window_end_us_ = (floor_divide(t, packet_us_) + 1) * packet_us_;
      packet.base = t * kNsPerUs + options_.offset_ns;
    }
    const std::size_t end = end_of_packet(packet);
    if (packet.events.size() + (end - position_) > kMostAtOnce)
      return error(position_,
                   text("more than ", kMostAtOnce, " events at ", t, " us: no sensor is that fast"),
                   "set events.time_unit to the unit of the stored stamps");
    if (end > position_) append(packet, end);
    if (position_ < sound_) return true;
  }
  if (sound_ == block_.count && !raw_fault_) return false;
  // What comes before a fault is still good.
  const std::int64_t t = suspect().t_us;
  if (!packet.empty() && t > last_us_ && (t >= window_end_us_ || packet.events.size() >= kMostEvents))
    return true;
  return fault();
}

Expected<bool> EventPacker::fetch() {
  if (fetch_raw_) {
    if (raw_end_ == raw_.size()) {
      raw_end_ = 0;
      const auto more = fetch_raw_(raw_);
      if (!more) return more.error();
      if (!*more) return false;
      if (raw_.size() == 0) {
        block_.count = 0;
        position_ = sound_ = 0;
        return true;
      }
    }
    narrow();
  } else {
    const auto more = fetch_block_(block_);
    if (!more) return more.error();
    if (!*more) return false;
  }
  position_ = 0;
  sound_ = sound();
  return true;
}

Expected<bool> EventPacker::next(EventPacket& packet) {
  packet.events.clear();
  while (!done_) {
    const auto full = take(packet);
    if (!full) return full.error();
    if (*full) break;
    const auto more = fetch();
    if (!more) return more.error();
    done_ = !*more;
  }
  return !packet.empty();
}

}  // namespace evpose
