// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/events/events_raw_writer.h"

#include <algorithm>

#include "evpose/io/events/evt3_words.h"

namespace evpose {
namespace {

constexpr int kLargestSide = 2048;
constexpr std::int64_t kLimitUs = std::int64_t{1} << 34;
constexpr int kLowBits = 12;
constexpr std::int64_t kLowMask = 0xFFF;
/// The high part wraps at 4096: a reader can follow jumps below half of that.
constexpr std::int64_t kLargestJump = 1024;
constexpr int kVectorPixels = 32;
constexpr std::size_t kFlushBytes = 256 << 10;

}  // namespace

EventWriterRaw::EventWriterRaw(AtomicFile file, ImageSize size, std::string path)
    : file_(std::move(file)), size_(size), path_(std::move(path)) {}

Expected<EventWriterRaw> EventWriterRaw::create(const std::string& path, ImageSize size) {
  EVPOSE_CHECK(size.width > 0 && size.height > 0);
  if (size.width > kLargestSide || size.height > kLargestSide)
    return Error{path, text("EVT3 cannot carry an image of ", size.width, " x ", size.height, " pixels"),
                 "write .h5 instead"};
  auto file = AtomicFile::create(path);
  if (!file) return file.error();
  file->write(text("% evt 3.0\n% format EVT3;height=", size.height, ";width=", size.width, "\n% geometry ",
                   size.width, "x", size.height, "\n% end\n"));
  return EventWriterRaw(*std::move(file), size, path);
}

void EventWriterRaw::put(unsigned kind, unsigned value) {
  buffer_ += static_cast<char>(value & 0xFF);
  buffer_ += static_cast<char>(kind << 4 | value >> 8);
}

void EventWriterRaw::put_time(std::int64_t t_us) {
  const std::int64_t high = t_us >> kLowBits;
  if (high_ < 0) high_ = 0, put(Evt3Word::kTimeHigh, 0);
  while (high_ < high) {
    high_ += high - high_ > kLargestJump ? kLargestJump : 1;
    put(Evt3Word::kTimeHigh, static_cast<unsigned>(high_ & kLowMask));
  }
  put(Evt3Word::kTimeLow, static_cast<unsigned>(t_us & kLowMask));
}

std::size_t EventWriterRaw::run_length(const EventPacket& packet, std::size_t i) {
  const Event& first = packet.events[i];
  std::size_t n = 1;
  int x = first.x;
  for (; i + n < packet.events.size(); ++n) {
    const Event& e = packet.events[i + n];
    if (e.dt_us != first.dt_us || e.y != first.y || e.on != first.on || e.x <= x ||
        e.x >= first.x + kVectorPixels)
      break;
    x = e.x;
  }
  return n;
}

void EventWriterRaw::put_vector(const EventPacket& packet, std::size_t begin, std::size_t end) {
  const Event& first = packet.events[begin];
  std::uint32_t mask = 0;
  for (std::size_t i = begin; i < end; ++i) mask |= 1u << (packet.events[i].x - first.x);
  put(Evt3Word::kVectorBase, static_cast<unsigned>(first.on << 11) | first.x);
  put(Evt3Word::kVector12, mask & 0xFFF);
  if (mask >> 12 != 0) put(Evt3Word::kVector12, mask >> 12 & 0xFFF);
  if (mask >> 24 != 0) put(Evt3Word::kVector8, mask >> 24);
}

Status EventWriterRaw::append(const EventPacket& packet) {
  for (std::size_t i = 0; i < packet.events.size();) {
    const Event& e = packet.events[i];
    const TimeNs t = packet.time(e);
    const std::int64_t t_us = t / kNsPerUs;
    if (t < 0 || t_us >= kLimitUs)
      return Error{path_,
                   text("EVT3 cannot carry the time ", t, " ns: it counts from 0 to ", kLimitUs - 1, " us"),
                   "give the events an offset so that they begin near 0, or write .h5"};
    EVPOSE_CHECK(t_us >= last_us_ && e.x < size_.width && e.y < size_.height);
    if (t_us != last_us_) put_time(t_us);
    last_us_ = t_us;
    if (e.y != y_) put(Evt3Word::kAddressY, e.y);
    y_ = e.y;
    const std::size_t run = run_length(packet, i);
    EVPOSE_CHECK(packet.events[i + run - 1].x < size_.width);
    const int span = packet.events[i + run - 1].x - e.x;
    if (run > (span < 12 ? 2u : span < 24 ? 3u : 4u)) {
      put_vector(packet, i, i + run);
      i += run;
    } else {
      put(Evt3Word::kAddressX, static_cast<unsigned>(e.on << 11) | e.x);
      ++i;
    }
  }
  if (buffer_.size() >= kFlushBytes) file_.write(buffer_), buffer_.clear();
  return {};
}

Status EventWriterRaw::finish() {
  file_.write(buffer_);
  buffer_.clear();
  return file_.commit();
}

}  // namespace evpose
