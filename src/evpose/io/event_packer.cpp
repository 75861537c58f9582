// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/event_packer.h"

#include <algorithm>
#include <cmath>

namespace evpose {
namespace {

constexpr std::size_t kMostEvents = 1 << 20;
/// More events at one microsecond than any sensor has pixels.
constexpr std::size_t kMostAtOnce = 8 << 20;
constexpr unsigned kMinusAndZero = 0b011;

std::int64_t floor_divide(std::int64_t a, std::int64_t b) { return a / b - (a % b < 0 ? 1 : 0); }
std::int64_t ceil_divide(std::int64_t a, std::int64_t b) { return -floor_divide(-a, b); }

}  // namespace

Expected<EventPacker> EventPacker::make(std::string path, const EventReadOptions& options, ImageSize size,
                                        Fetch fetch) {
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
  packer.fetch_ = std::move(fetch);
  packer.packet_us_ = std::llround(options.packet_s * 1e6);
  if (options.t_start_ns) packer.first_us_ = ceil_divide(*options.t_start_ns - options.offset_ns, kNsPerUs);
  if (options.t_end_ns) packer.stop_us_ = ceil_divide(*options.t_end_ns - options.offset_ns, kNsPerUs);
  if (size.width > 0) packer.widest_ = size.width;
  if (size.height > 0) packer.highest_ = size.height;
  return packer;
}

Error EventPacker::error(std::size_t i, const std::string& what, const std::string& fix) const {
  if (!block_.line.empty()) return Error{text(path_, ":", block_.line[i]), what, fix};
  return Error{path_, text("event ", block_.first_row + static_cast<std::int64_t>(i), " (from 0): ", what),
               fix};
}

bool EventPacker::plausible(std::size_t i) {
  const std::int64_t t = block_.t_us[i];
  const std::int32_t x = block_.x[i], y = block_.y[i], p = block_.p[i];
  if (t < last_us_ || t > kLargestTimeUs || t < -kLargestTimeUs) return false;
  if (x < 0 || x >= widest_ || y < 0 || y >= highest_ || p < -1 || p > 1) return false;
  polarities_ |= 1u << (p + 1);
  return (polarities_ & kMinusAndZero) != kMinusAndZero;
}

Error EventPacker::fault(std::size_t i) const {
  const std::int64_t t = block_.t_us[i];
  if (t < last_us_)
    return error(i, text("the stamp ", t, " us goes back behind ", last_us_, " us: out of order"),
                 "sort the events by time");
  if (t > kLargestTimeUs || t < -kLargestTimeUs)
    return error(i, text("the stamp ", t, " us is out of range"), "set events.time_unit, e.g. ns");
  const std::int32_t x = block_.x[i], y = block_.y[i], p = block_.p[i];
  if (x < 0 || x >= widest_ || y < 0 || y >= highest_)
    return error(i, text("pixel (", x, ", ", y, ") lies outside of the image of ", widest_, " x ", highest_),
                 "check events.resolution and the calibration's resolution");
  if (p < -1 || p > 1) return error(i, text("polarity ", p, " is neither 0/1 nor -1/+1"), "correct the file");
  return error(i, "the file has both polarities 0 and -1", "store either 0/1 or -1/+1");
}

void EventPacker::push(EventPacket& packet, std::size_t i) {
  const std::int64_t t = block_.t_us[i];
  if (packet.empty()) {
    base_us_ = t;
    window_end_us_ = (floor_divide(t, packet_us_) + 1) * packet_us_;
    packet.base = t * kNsPerUs + options_.offset_ns;
  }
  const int x = options_.flip_x ? size_.width - 1 - block_.x[i] : block_.x[i];
  const int y = options_.flip_y ? size_.height - 1 - block_.y[i] : block_.y[i];
  const bool on = (block_.p[i] == 1) != options_.swap_polarity;
  packet.events.push_back(make_event(static_cast<std::uint32_t>(t - base_us_), x, y, on));
}

Expected<bool> EventPacker::take(EventPacket& packet) {
  for (const std::size_t n = block_.size(); position_ < n; ++position_) {
    const std::int64_t t = block_.t_us[position_];
    // A packet never ends between equal stamps; one that goes back is not plausible, below.
    const bool may_end = t > last_us_ && !packet.empty();
    if (may_end && (t >= window_end_us_ || packet.events.size() >= kMostEvents)) return true;
    if (!plausible(position_)) return fault(position_);
    last_us_ = t;
    if (t < first_us_) continue;
    if (t >= stop_us_) {
      done_ = true;
      return true;
    }
    if (packet.events.size() >= kMostAtOnce)
      return error(position_,
                   text("more than ", kMostAtOnce, " events at ", t, " us: no sensor is that fast"),
                   "set events.time_unit to the unit of the stored stamps");
    push(packet, position_);
  }
  return false;
}

Expected<bool> EventPacker::next(EventPacket& packet) {
  packet.events.clear();
  while (!done_) {
    const auto full = take(packet);
    if (!full) return full.error();
    if (*full) break;
    position_ = 0;
    const auto more = fetch_(block_);
    if (!more) return more.error();
    done_ = !*more;
  }
  return !packet.empty();
}

}  // namespace evpose
