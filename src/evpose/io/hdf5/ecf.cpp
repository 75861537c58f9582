// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/hdf5/ecf.h"

#include <algorithm>
#include <array>
#include <cstring>

namespace evpose {
namespace {

constexpr std::size_t kMostEvents = 65535;

/// Reads numbers until the bytes end; then zeros, and `short_` is set.
class Cursor {
 public:
  explicit Cursor(std::span<const std::byte> bytes) : bytes_(bytes) {}

  template <class T>
  T take() {
    T value{};
    if (bytes_.size() < sizeof(T)) {
      short_ = true;
      return value;
    }
    std::memcpy(&value, bytes_.data(), sizeof(T));
    bytes_ = bytes_.subspan(sizeof(T));
    return value;
  }
  bool ran_short() const { return short_; }

 private:
  std::span<const std::byte> bytes_;
  bool short_ = false;
};

using Events = std::span<EcfEvent>;

/// Steps of time, each with the number of events that follow it.
bool read_times(Cursor& in, Events events) {
  auto t = in.take<std::uint64_t>();
  std::uint64_t step = 0;
  unsigned shift = 0;
  for (std::size_t done = 0; done < events.size();) {
    const auto byte = in.take<std::uint8_t>();
    if (in.ran_short()) return false;
    const unsigned high = byte >> 4, low = byte & 15u;
    if (high == 15) {  // a piece of a long step
      if (shift < 64) step |= static_cast<std::uint64_t>(low) << shift;
      shift += 4;
      continue;
    }
    t += step + high;
    step = shift = 0;
    const std::size_t count = low == 15 ? in.take<std::uint16_t>() : low;
    if (count > events.size() - done) return false;
    for (const std::size_t end = done + count; done < end; ++done)
      events[done].t_us = static_cast<std::int64_t>(t);
  }
  return true;
}

/// Rows, columns and polarities of four events in three words of 32 bits.
void read_packed_all(Cursor& in, Events events) {
  for (std::size_t i = 0; i < events.size() && !in.ran_short(); i += 4) {
    const auto a = in.take<std::uint32_t>(), b = in.take<std::uint32_t>(), c = in.take<std::uint32_t>();
    const std::array<std::uint32_t, 4> packed = {a >> 8, (a & 0xFF) | b >> 16 << 8,
                                                 (b & 0xFFFF) | c >> 24 << 16, c & 0xFFFFFF};
    for (std::size_t k = 0; k < 4 && i + k < events.size(); ++k) {
      events[i + k].p = static_cast<std::int16_t>(packed[k] & 1);
      events[i + k].x = packed[k] >> 1 & 0x7FF;
      events[i + k].y = packed[k] >> 12 & 0x7FF;
    }
  }
}

/// Columns and polarities of four events in three words of 16 bits.
void read_packed_columns(Cursor& in, Events events) {
  for (std::size_t i = 0; i < events.size() && !in.ran_short(); i += 4) {
    const unsigned a = in.take<std::uint16_t>(), b = in.take<std::uint16_t>(), c = in.take<std::uint16_t>();
    const std::array<unsigned, 4> packed = {a >> 4, (a & 15) | b >> 8 << 4, (b & 0xFF) | c >> 12 << 8,
                                            c & 0xFFF};
    for (std::size_t k = 0; k < 4 && i + k < events.size(); ++k) {
      events[i + k].p = static_cast<std::int16_t>(packed[k] & 1);
      events[i + k].x = static_cast<std::uint16_t>(packed[k] >> 1);
    }
  }
}

bool read_rows(Cursor& in, Events events) {
  for (std::size_t done = 0; done < events.size();) {
    const unsigned word = in.take<std::uint16_t>();
    std::size_t run = word & 31;
    if (run == 31) run = in.take<std::uint16_t>();
    if (in.ran_short() || run > events.size() - done) return false;
    for (const std::size_t end = done + run; done < end; ++done)
      events[done].y = static_cast<std::uint16_t>(word >> 5);
  }
  return true;
}

/// A column, and which of the five to its right follow.
bool read_columns(Cursor& in, Events events) {
  for (std::size_t done = 0; done < events.size();) {
    const unsigned word = in.take<std::uint16_t>();
    if (in.ran_short()) return false;
    events[done++].x = static_cast<std::uint16_t>(word >> 5);
    for (unsigned right = 1; right <= 5; ++right) {
      if ((word >> (5 - right) & 1) == 0) continue;
      if (done == events.size()) return false;
      events[done++].x = static_cast<std::uint16_t>((word >> 5) + right);
    }
  }
  return true;
}

bool read_polarities(Cursor& in, Events events) {
  for (std::size_t done = 0; done < events.size();) {
    const unsigned byte = in.take<std::uint8_t>();
    std::size_t run = byte & 127;
    if (run == 127) run = in.take<std::uint16_t>();
    if (in.ran_short() || run > events.size() - done) return false;
    for (const std::size_t end = done + run; done < end; ++done)
      events[done].p = static_cast<std::int16_t>(byte >> 7);
  }
  return true;
}

}  // namespace

bool decode_ecf(std::span<const std::byte> block, std::vector<EcfEvent>& events) {
  Cursor in(block);
  const auto header = in.take<std::uint32_t>();
  const std::size_t count = header >> 2;
  const bool all_packed = (header & 2) != 0, columns_packed = (header & 1) != 0;
  // Each event takes at least a bit or so; no block of a few bytes may ask for the most.
  if (in.ran_short() || count > kMostEvents) return false;
  events.assign(count, {});
  if (!read_times(in, events)) return false;
  if (all_packed) {
    read_packed_all(in, events);
    return !in.ran_short();
  }
  if (!read_rows(in, events)) return false;
  if (columns_packed) {
    read_packed_columns(in, events);
    return !in.ran_short();
  }
  return read_columns(in, events) && read_polarities(in, events);
}

}  // namespace evpose
