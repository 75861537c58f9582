// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/evt3.h"

#include <algorithm>
#include <bit>
#include <cstring>

namespace evpose {
namespace {

enum Kind : unsigned {
  kAddressY = 0x0,
  kAddressX = 0x2,
  kVectorBase = 0x3,
  kVector12 = 0x4,
  kVector8 = 0x5,
  kTimeLow = 0x6,
  kContinued4 = 0x7,
  kTimeHigh = 0x8,
  kTrigger = 0xA,
  kOthers = 0xE,
  kContinued12 = 0xF,
};

constexpr std::int64_t kLoopUs = 1 << 24;
constexpr unsigned kHighs = 4096;
/// Steps back, in units of the high part, that cameras are known to make without having lost the time.
constexpr unsigned kHiccup = 10;
constexpr std::size_t kWidestVector = 12;

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
      case kAddressY:
        set_y(word);
        break;
      case kVectorBase:
        set_base(word);
        break;
      case kTimeHigh:
        set_high(word & 0xFFF);
        break;
      case kTimeLow:
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
  constexpr unsigned kVectors = 1u << kVector12 | 1u << kVector8;
  constexpr unsigned kPlain =
      1u << kAddressY | 1u << kAddressX | 1u << kTimeLow | 1u << kVectorBase | kVectors;
  const unsigned same_high = kTimeHigh << 12 | high_, width = width_, height = height_;
  const std::int64_t high_dt = high_us_ - block.base_us;
  std::int64_t dt = now_us_ - block.base_us;
  unsigned y = y_, base_x = base_x_, base_on = base_on_;
  Event* const begin = block.events.data() + block.count;
  Event* const full = block.events.data() + (block.events.size() - kWidestVector);
  Event* out = begin;
  std::size_t i = 0;
  for (; i < words && out <= full; ++i) {
    const unsigned word = load(bytes, i), kind = word >> 12, x = word & 0x7FF;
    if ((kPlain >> kind & 1) == 0 && word != same_high) break;
    if ((kVectors >> kind & 1) != 0) {
      unsigned mask = kind == kVector12 ? word & 0xFFF : word & 0xFF;
      if (base_x + std::bit_width(mask) > width || y >= height) break;
      const std::uint64_t first = event_bits(static_cast<std::uint32_t>(dt), base_x, y, base_on);
      for (; mask != 0; mask &= mask - 1)
        *out++ = event_of_bits(first + (static_cast<std::uint64_t>(std::countr_zero(mask)) << 32));
      base_x = (base_x + (kind == kVector12 ? 12 : 8)) & 0xFFFF;
      continue;
    }
    const std::int64_t told = high_dt + (word & 0xFFF);
    if (static_cast<bool>(static_cast<unsigned>(kind == kTimeLow) & static_cast<unsigned>(told < dt))) break;
    const bool is_event = kind == kAddressX;
    const bool outside =
        static_cast<bool>(static_cast<unsigned>(x >= width) | static_cast<unsigned>(y >= height));
    if (static_cast<bool>(static_cast<unsigned>(is_event) & static_cast<unsigned>(outside))) break;
    *out = event_of_bits(event_bits(static_cast<std::uint32_t>(dt), x, y, word >> 11 & 1));
    out += is_event ? 1 : 0;
    y = kind == kAddressY ? x : y;
    base_x = kind == kVectorBase ? x : base_x;
    base_on = kind == kVectorBase ? word >> 11 & 1 : base_on;
    dt = kind == kTimeLow ? told : dt;
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
    if (kind == kTimeLow) {
      now_us_ = high_us_ + (word & 0xFFF);
    } else if (kind == kAddressY) {
      set_y(word);
    } else if (kind == kAddressX) {
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
      case kAddressX:  // plain() stops only at one outside
        ++faults_.outside;
        break;
      case kTimeLow:
        now_us_ = high_us_ + value;
        break;
      case kVectorBase:
        set_base(word);
        break;
      case kVector12:
        vector(value, 12, block);
        break;
      case kVector8:
        vector(value & 0xFF, 8, block);
        break;
      case kTimeHigh:
        set_high(value);
        break;
      case kTrigger:
        if (triggers != nullptr)
          triggers->push_back({now_us_ * kNsPerUs, (word & 1) != 0, static_cast<int>(word >> 8 & 0xF)});
        break;
      case kOthers:
      case kContinued4:
      case kContinued12:
        break;
      default:
        ++faults_.skipped_words;
    }
  }
  return 2 * i;
}

}  // namespace evpose
