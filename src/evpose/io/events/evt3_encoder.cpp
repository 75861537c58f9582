// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/events/evt3_encoder.h"

namespace evpose {

void Evt3Encoder::encode(std::span<const Event> events, std::int64_t base_us,
                         std::vector<std::uint16_t>& words) {
  enum Type : unsigned { kY = 0x0, kX = 0x2, kTimeLow = 0x6, kTimeHigh = 0x8 };
  constexpr unsigned kPolarity = 1 << 11;
  const auto put = [&words](Type type, unsigned payload) {
    words.push_back(static_cast<std::uint16_t>(type << 12 | payload));
  };
  for (const Event& e : events) {
    const std::int64_t t_us = base_us + e.dt_us, high = t_us >> 12, low = t_us & 0xFFF;
    if (high != high_) {
      // Each step is sent: from a jump of half the counter or more the decoder could not tell how far.
      for (std::int64_t h = high_ < 0 ? high : high_ + 1; h <= high; ++h) put(kTimeHigh, h & 0xFFF);
      high_ = high, low_ = -1;
    }
    if (low != low_) put(kTimeLow, static_cast<unsigned>(low_ = low));
    if (e.y != y_) put(kY, static_cast<unsigned>(y_ = e.y));
    put(kX, e.x | (e.on ? kPolarity : 0U));
  }
}

}  // namespace evpose
