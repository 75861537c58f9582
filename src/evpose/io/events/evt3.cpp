// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/events/evt3.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>

#include "evpose/io/events/evt3_words.h"

namespace evpose {
namespace {

constexpr std::int64_t kLoopUs = 1 << 24;
constexpr unsigned kHighs = 4096;
/// Steps back, in units of the high part, that cameras are known to make without having lost the time.
constexpr unsigned kHiccup = 10;
constexpr std::size_t kWidestVector = 12;
/// None of these bits is set in words of the kinds Evt3Word::kAddressY and Evt3Word::kAddressX.
constexpr unsigned kRowOrEvent = 0xD000;

/// Four events in one register, where the processor has such wide ones.
using Four = std::uint64_t __attribute__((vector_size(32)));

/// Four neighbouring pixels by the pattern of those that are there: what each adds to the event at the first.
/// Those behind the last are room that the next ones overwrite.
constexpr std::array<Four, 16> make_quads() {
  std::array<Four, 16> all{};
  for (unsigned mask = 0; mask < 16; ++mask) {
    std::array<std::uint64_t, 4> add{};
    std::size_t n = 0;
    for (unsigned k = 0; k < 4; ++k)
      if ((mask >> k & 1) != 0) add[n++] = std::uint64_t{k} << 32;
    all[mask] = Four{add[0], add[1], add[2], add[3]};
  }
  return all;
}
constexpr std::array<Four, 16> kQuads = make_quads();

/// Writes the pixels of `mask`, of four bits; returns where the next goes. Room for four is needed.
Event* write_quad(std::uint64_t first, unsigned mask, Event* out) {
  const Four events = kQuads[mask] + first;
  std::memcpy(out, &events, sizeof(events));
  return out + std::popcount(mask);
}

unsigned load(const std::byte* bytes, std::size_t word) {
  std::uint16_t value = 0;
  std::memcpy(&value, bytes + 2 * word, 2);
  return value;
}

}  // namespace

Evt3Decoder::Evt3Decoder(ImageSize size)
    : width_(size.width > 0 ? static_cast<std::uint32_t>(size.width) : 1u << 16),
      height_(size.height > 0 ? static_cast<std::uint32_t>(size.height) : 1u << 15) {}

void Evt3Decoder::set_y(unsigned word) { y_ = word & 0x7FF; }

void Evt3Decoder::set_base(unsigned word) {
  base_x_ = word & 0x7FF;
  base_on_ = word >> 11 & 1;
}

void Evt3Decoder::set_high(unsigned high) {
  if (!has_high_) {
    has_high_ = true;
  } else if (high != high_) {
    const unsigned back = (high_ - high) % kHighs, ahead = (high - high_) % kHighs;
    const bool over_the_end = high > high_ && back <= kHiccup && loop_us_ > 0;
    if (high_ >= high + kHighs / 2) loop_us_ += kLoopUs;
    if (over_the_end) loop_us_ -= kLoopUs;
    if (over_the_end || (high < high_ && back < kHighs / 2)) {
      faults_.discontinuities += back > kHiccup ? 1 : 0;
    } else {
      faults_.missing_time_high += ahead > 1 ? 1 : 0;
    }
  } else {
    return;
  }
  high_ = high;
  now_us_ = high_us_ = loop_us_ + (static_cast<std::int64_t>(high) << 12);
}

/// Until the first low part of the time after a high part.
std::size_t Evt3Decoder::begin(const std::byte* bytes, std::size_t words) {
  for (std::size_t i = 0; i < words; ++i) {
    const unsigned word = load(bytes, i);
    switch (word >> 12) {
      case Evt3Word::kAddressY:
        set_y(word);
        break;
      case Evt3Word::kVectorBase:
        set_base(word);
        break;
      case Evt3Word::kTimeHigh:
        set_high(word & 0xFFF);
        break;
      case Evt3Word::kTimeLow:
        if (!has_high_) break;
        now_us_ = high_us_ + (word & 0xFFF);
        started_ = true;
        return i + 1;
      default:
        break;
    }
  }
  return words;
}

bool Evt3Decoder::has_room(const EventBlock& block) const {
  return block.count + kWidestVector <= block.events.size() &&
         (block.count == 0 || std::max(now_us_, last_us_) - block.base_us <= UINT32_MAX - kLoopUs);
}

/// Rows, single events and times that go on in the same high part: with next to no branch that depends on the
/// data, which is what makes it fast. Stops at any other word, at an event outside, and where the block is
/// full.
std::size_t Evt3Decoder::plain(const std::byte* bytes, std::size_t words, EventBlock& block) {
  const unsigned same_high = Evt3Word::kTimeHigh << 12 | high_, width = width_, height = height_;
  const std::int64_t high_dt = high_us_ - block.base_us;
  std::int64_t dt = now_us_ - block.base_us;
  unsigned y = y_, base_x = base_x_, base_on = base_on_;
  Event* const begin = block.events.data() + block.count;
  Event* const full = block.events.data() + (block.events.size() - kWidestVector);
  Event* out = begin;
  std::size_t i = 0;
  for (; i < words && out <= full; ++i) {
    const unsigned word = load(bytes, i), kind = word >> 12, value = word & 0x7FF;
    if ((word & kRowOrEvent) == 0) {  // most of the words, in an order that cannot be foreseen
      const unsigned is_event = kind >> 1, is_row = is_event - 1;  // the latter as a mask
      const unsigned outside = static_cast<unsigned>(value >= width) | static_cast<unsigned>(y >= height);
      if ((is_event & outside) != 0) break;
      const std::uint64_t place = (word & 0x7FFu) | (word & 0x800u) << 20;
      *out = event_of_bits(event_bits(static_cast<std::uint32_t>(dt), 0, y, 0) + (place << 32));
      out += is_event;
      y = (y & ~is_row) | (value & is_row);
    } else if (kind == Evt3Word::kVectorBase) {
      base_x = value;
      base_on = word >> 11 & 1;
    } else if (kind == Evt3Word::kVector12 || kind == Evt3Word::kVector8) {
      const unsigned mask = word & (kind == Evt3Word::kVector12 ? 0xFFFu : 0xFFu);
      if (base_x + static_cast<unsigned>(std::bit_width(mask)) > width || y >= height) break;
      const std::uint64_t first = event_bits(static_cast<std::uint32_t>(dt), base_x, y, base_on);
      out = write_quad(first, mask & 0xF, out);
      out = write_quad(first + (std::uint64_t{4} << 32), mask >> 4 & 0xF, out);
      out = write_quad(first + (std::uint64_t{8} << 32), mask >> 8, out);
      base_x = (base_x + (kind == Evt3Word::kVector12 ? 12 : 8)) & 0xFFFF;
    } else if (kind == Evt3Word::kTimeLow) {
      const std::int64_t told = high_dt + (word & 0xFFF);
      if (told < dt) break;
      dt = told;
    } else if (word != same_high) {
      break;
    }
  }
  block.count = static_cast<std::size_t>(out - block.events.data());
  y_ = y, base_x_ = base_x, base_on_ = base_on;
  now_us_ = block.base_us + dt;
  if (out > begin) last_us_ = block.time_us(block.count - 1);
  return i;
}

/// The same while the camera's time is behind that of the last event. Of the words that plain() takes it
/// takes all, and counts what it drops and what it holds back.
std::size_t Evt3Decoder::held(const std::byte* bytes, std::size_t words, EventBlock& block) {
  std::size_t i = 0;
  for (; i < words && now_us_ < last_us_ && block.count < block.events.size(); ++i) {
    const unsigned word = load(bytes, i), kind = word >> 12;
    if (kind == Evt3Word::kTimeLow) {
      now_us_ = high_us_ + (word & 0xFFF);
    } else if (kind == Evt3Word::kAddressY) {
      set_y(word);
    } else if (kind == Evt3Word::kAddressX) {
      const unsigned x = word & 0x7FF;
      const auto dt = static_cast<std::uint32_t>(last_us_ - block.base_us);
      block.events[block.count] = event_of_bits(event_bits(dt, x, y_, word >> 11 & 1));
      const bool inside = x < width_ && y_ < height_;
      block.count += inside ? 1 : 0;
      faults_.outside += inside ? 0 : 1;
      faults_.time_regressions += inside ? 1 : 0;
    } else {
      break;
    }
  }
  return i;
}

void Evt3Decoder::vector(unsigned mask, unsigned length, EventBlock& block) {
  const std::int64_t stamp = std::max(now_us_, last_us_);
  const auto dt = static_cast<std::uint32_t>(stamp - block.base_us);
  const std::size_t before = block.count;
  for (unsigned left = mask; left != 0; left &= left - 1) {
    const unsigned x = base_x_ + static_cast<unsigned>(std::countr_zero(left));
    block.events[block.count] = event_of_bits(event_bits(dt, x, y_, base_on_));
    const bool inside = x < width_ && y_ < height_;
    block.count += inside ? 1 : 0;
    faults_.outside += inside ? 0 : 1;
  }
  if (block.count > before) {
    if (now_us_ < last_us_) faults_.time_regressions += static_cast<std::int64_t>(block.count - before);
    last_us_ = stamp;
  }
  base_x_ = (base_x_ + length) & 0xFFFF;
}

std::size_t Evt3Decoder::decode(std::span<const std::byte> bytes, EventBlock& block,
                                std::vector<Trigger>* triggers) {
  const std::size_t words = bytes.size() / 2;
  std::size_t i = started_ ? 0 : begin(bytes.data(), words);
  while (i < words && has_room(block)) {
    // Within one high part time may still go back to its beginning, but not before the base.
    if (block.count == 0) block.base_us = std::max(last_us_, high_us_);
    if (now_us_ < last_us_) {
      i += held(bytes.data() + 2 * i, words - i, block);
      if (now_us_ >= last_us_) continue;
    } else {
      i += plain(bytes.data() + 2 * i, words - i, block);
    }
    if (i == words || !has_room(block)) break;
    const unsigned word = load(bytes.data(), i++), value = word & 0xFFF;
    switch (word >> 12) {
      case Evt3Word::kAddressX:  // plain() stops only at one outside
        ++faults_.outside;
        break;
      case Evt3Word::kTimeLow:
        now_us_ = high_us_ + value;
        break;
      case Evt3Word::kVectorBase:
        set_base(word);
        break;
      case Evt3Word::kVector12:
        vector(value, 12, block);
        break;
      case Evt3Word::kVector8:
        vector(value & 0xFF, 8, block);
        break;
      case Evt3Word::kTimeHigh:
        set_high(value);
        break;
      case Evt3Word::kTrigger:
        if (triggers != nullptr)
          triggers->push_back({now_us_ * kNsPerUs, (word & 1) != 0, static_cast<int>(word >> 8 & 0xF)});
        break;
      case Evt3Word::kOthers:
      case Evt3Word::kContinued4:
      case Evt3Word::kContinued12:
        break;
      default:
        ++faults_.skipped_words;
    }
  }
  return 2 * i;
}

}  // namespace evpose
