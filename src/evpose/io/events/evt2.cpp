// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/events/evt2.h"

#include <algorithm>
#include <bit>
#include <cstring>

namespace evpose {
namespace {

enum Kind : unsigned {
  kOff = 0x0,
  kOn = 0x1,
  kTimeHigh = 0x8,
  kTrigger = 0xA,
  kImu = 0xD,
  kOthers = 0xE,
  kContinued = 0xF
};

constexpr std::int64_t kWrapUs = std::int64_t{1} << 34;
/// A step back of nearly the whole range is a wrap; cameras begin anew a little late or early.
constexpr std::int64_t kWrapStepUs = kWrapUs - 64 - 10'000;
/// Steps back that cameras are known to make without having lost the time.
constexpr std::int64_t kHiccupUs = 10 * 4096;
/// Words taken one by one where a group of them was not of the usual kind.
constexpr std::size_t kBetweenGroups = 8;
/// What a block may span, short of what Event holds.
constexpr std::int64_t kBlockSpanUs = std::int64_t{1} << 31;
constexpr std::size_t kWidestVector = 32;
/// The most that the low part of the time can be.
constexpr std::uint32_t kLowUs = 63;

/// What the registers of current processors hold; others take it in parts.
constexpr std::size_t kGroup = 8;
using Words = std::uint32_t __attribute__((vector_size(4 * kGroup)));
using Signed = std::int32_t __attribute__((vector_size(4 * kGroup)));
using Pairs = std::uint64_t __attribute__((vector_size(4 * kGroup)));
using Events = std::uint64_t __attribute__((vector_size(8 * kGroup)));

template <class Word>
Word load_word(const std::byte* bytes, std::size_t word) {
  Word value = 0;
  std::memcpy(&value, bytes + sizeof(Word) * word, sizeof(Word));
  return value;
}

std::uint64_t side(int pixels, std::uint64_t unknown) {
  return pixels > 0 ? static_cast<std::uint64_t>(pixels) : unknown;
}

bool has_room(const EventBlock& block, std::size_t wanted, std::int64_t t_us) {
  return block.count + wanted <= block.events.size() &&
         (block.count == 0 || t_us - block.base_us <= kBlockSpanUs);
}

bool is_known(unsigned kind) {
  return kind == kTrigger || kind == kImu || kind == kOthers || kind == kContinued;
}

}  // namespace

void Evt2Clock::set(std::uint32_t high, DecodeFaults& faults) {
  std::int64_t next = wraps_us_ + (static_cast<std::int64_t>(high) << 6);
  if (started_ && next < high_us_) {
    if (high_us_ - next >= kWrapStepUs) {
      wraps_us_ += kWrapUs;
      next += kWrapUs;
    } else if (high_us_ - next > kHiccupUs) {
      ++faults.discontinuities;
    }
  }
  started_ = true;
  high_us_ = next;
}

Evt2Decoder::Evt2Decoder(ImageSize size)
    : width_(side(size.width, 1 << 16)), height_(side(size.height, 1 << 15)) {}

/// Groups of events that are all sound and in order, as most are, eight in a register. Returns the number of
/// words taken.
std::size_t Evt2Decoder::groups(const std::byte* bytes, std::size_t words, EventBlock& block) {
  const std::int64_t behind_us = last_us_ > clock_.high_us() ? last_us_ - clock_.high_us() : 0;
  if (behind_us > kLowUs) return 0;
  const auto high_dt = static_cast<std::uint32_t>(clock_.high_us() - block.base_us);
  const auto last_column = static_cast<std::int32_t>(width_) - 1;
  const auto last_row = static_cast<std::int32_t>(height_) - 1;
  std::size_t i = 0;
  // Each time is held against the one at its left: that of the first word against the last event's.
  Words left = Words{} + (static_cast<std::uint32_t>(behind_us) << 22);
  for (; i + kGroup <= words && block.count + kGroup <= block.events.size(); i += kGroup) {
    Words word;  // NOLINT(cppcoreguidelines-pro-type-member-init): filled below
    std::memcpy(&word, bytes + 4 * i, sizeof(word));
    if (i > 0)
      std::memcpy(&left, bytes + 4 * i - 4, sizeof(left));
    else
      std::memcpy(reinterpret_cast<std::byte*>(&left) + 4, bytes, sizeof(left) - 4);
    const Words low = word >> 22 & kLowUs, x = word >> 11 & 0x7FF, y = word & 0x7FF;
    const Signed faults = (Signed(low) < Signed(left >> 22 & kLowUs)) | (Signed(x) > last_column) |
                          (Signed(y) > last_row) | Signed(word >> 29);
    const auto any = Pairs(faults);
    if ((any[0] | any[1] | any[2] | any[3]) != 0) break;
    const Events events = __builtin_convertvector(low + high_dt, Events) |
                          __builtin_convertvector(x | y << 16 | word >> 28 << 31, Events) << 32;
    std::memcpy(block.events.data() + block.count, &events, sizeof(events));
    block.count += kGroup;
  }
  if (i > 0) last_us_ = block.time_us(block.count - 1);
  return i;
}

/// Events and time words that go forward, without branches that depend on the data. A group's worth at a
/// time.
std::size_t Evt2Decoder::plain(const std::byte* bytes, std::size_t words, EventBlock& block) {
  const std::int64_t wraps_us = clock_.wraps_us(), base_us = block.base_us;
  std::int64_t high = clock_.high_us(), last = last_us_, held = 0, outside = 0;
  Event* out = block.events.data() + block.count;
  Event* const full = block.events.data() + block.events.size();
  std::size_t i = 0;
  for (; i < words && out < full; ++i) {
    const auto word = load_word<std::uint32_t>(bytes, i);
    const unsigned kind = word >> 28;
    const std::int64_t told = wraps_us + (static_cast<std::int64_t>(word & 0xFFFFFFF) << 6);
    const bool is_event = kind <= kOn;
    const bool goes_on = kind == kTimeHigh && told >= high && told - base_us <= kBlockSpanUs;
    if (!static_cast<bool>(static_cast<unsigned>(is_event) | static_cast<unsigned>(goes_on))) break;
    const std::int64_t t = high + (word >> 22 & 0x3F), stamp = std::max(t, last);
    const std::uint64_t x = word >> 11 & 0x7FF, y = word & 0x7FF;
    *out = event_of_bits(event_bits(static_cast<std::uint32_t>(stamp - base_us), x, y, kind & 1));
    const bool inside =
        static_cast<bool>(static_cast<unsigned>(x < width_) & static_cast<unsigned>(y < height_));
    const bool taken = static_cast<bool>(static_cast<unsigned>(is_event) & static_cast<unsigned>(inside));
    out += taken ? 1 : 0;
    outside += is_event != taken ? 1 : 0;
    held += taken ? static_cast<std::int64_t>(t < last) : 0;
    last = taken ? stamp : last;
    high = is_event ? high : told;
  }
  block.count = static_cast<std::size_t>(out - block.events.data());
  clock_.advance(high);
  last_us_ = last;
  faults_.time_regressions += held;
  faults_.outside += outside;
  return i;
}

std::size_t Evt2Decoder::decode(std::span<const std::byte> bytes, EventBlock& block,
                                std::vector<Trigger>* triggers) {
  const std::size_t words = bytes.size() / 4;
  std::size_t i = 0;
  while (i < words && has_room(block, 1, std::max(clock_.high_us(), last_us_))) {
    if (clock_.started()) {
      if (block.count == 0) block.base_us = std::max(last_us_, clock_.high_us());
      if (clock_.high_us() >= block.base_us) i += groups(bytes.data() + 4 * i, words - i, block);
      const std::size_t some = std::min(words - i, kBetweenGroups);
      const std::size_t taken = plain(bytes.data() + 4 * i, some, block);
      i += taken;
      if (taken == some) continue;
      if (!has_room(block, 1, 0)) break;
    }
    const auto word = load_word<std::uint32_t>(bytes.data(), i++);
    const unsigned kind = word >> 28;
    if (kind == kTimeHigh) {
      clock_.set(word & 0xFFFFFFF, faults_);
    } else if (kind == kTrigger && clock_.started() && triggers != nullptr) {
      const std::int64_t t = clock_.high_us() + (word >> 22 & 0x3F);
      triggers->push_back({t * kNsPerUs, (word & 1) != 0, static_cast<int>(word >> 8 & 0x1F)});
    } else if (kind > kOn && !is_known(kind)) {
      ++faults_.skipped_words;
    }
  }
  return 4 * i;
}

Evt21Decoder::Evt21Decoder(ImageSize size, bool legacy)
    : width_(side(size.width, 1 << 16)), height_(side(size.height, 1 << 15)), legacy_(legacy) {}

std::size_t Evt21Decoder::time_words(std::span<const std::byte> bytes, bool legacy) {
  std::size_t count = 0;
  for (std::size_t i = 0; i < bytes.size() / 8; ++i) {
    const auto word = load_word<std::uint64_t>(bytes.data(), i);
    count += (legacy ? std::rotl(word, 32) : word) >> 60 == kTimeHigh ? 1 : 0;
  }
  return count;
}

void Evt21Decoder::events(std::uint64_t word, EventBlock& block) {
  const std::int64_t t = clock_.high_us() + static_cast<std::int64_t>(word >> 54 & 0x3F);
  const std::int64_t stamp = std::max(t, last_us_);
  if (block.count == 0) block.base_us = stamp;
  const std::uint64_t x = word >> 43 & 0x7FF, y = word >> 32 & 0x7FF;
  const std::uint64_t first = event_bits(static_cast<std::uint32_t>(stamp - block.base_us), x, y, word >> 60);
  const std::size_t before = block.count;
  for (auto mask = static_cast<std::uint32_t>(word); mask != 0; mask &= mask - 1) {
    const auto step = static_cast<std::uint64_t>(std::countr_zero(mask));
    block.events[block.count] = event_of_bits(first + (step << 32));
    const bool inside = x + step < width_ && y < height_;
    block.count += inside ? 1 : 0;
    faults_.outside += inside ? 0 : 1;
  }
  if (block.count == before) return;
  if (t < last_us_) faults_.time_regressions += static_cast<std::int64_t>(block.count - before);
  last_us_ = stamp;
}

std::size_t Evt21Decoder::decode(std::span<const std::byte> bytes, EventBlock& block,
                                 std::vector<Trigger>* triggers) {
  const std::size_t words = bytes.size() / 8;
  std::size_t i = 0;
  for (; i < words && has_room(block, kWidestVector, std::max(clock_.high_us(), last_us_)); ++i) {
    const auto stored = load_word<std::uint64_t>(bytes.data(), i);
    const std::uint64_t word = legacy_ ? std::rotl(stored, 32) : stored;
    const auto kind = static_cast<unsigned>(word >> 60);
    if (kind <= kOn) {
      if (clock_.started()) events(word, block);
    } else if (kind == kTimeHigh) {
      clock_.set(static_cast<std::uint32_t>(word >> 32 & 0xFFFFFFF), faults_);
    } else if (kind == kTrigger && clock_.started() && triggers != nullptr) {
      const std::int64_t t = clock_.high_us() + static_cast<std::int64_t>(word >> 54 & 0x3F);
      triggers->push_back({t * kNsPerUs, (word >> 32 & 1) != 0, static_cast<int>(word >> 40 & 0x1F)});
    } else if (!is_known(kind)) {
      ++faults_.skipped_words;
    }
  }
  return 8 * i;
}

}  // namespace evpose
