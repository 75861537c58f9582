// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace evpose {

/// In place of the number that a contrast segment had before: it had none.
constexpr std::uint32_t kNewSegment = ~0U;

/// What is known of each segment, once they are those of another part of the map: number i was `before[i]`,
/// or is new (kNewSegment) and T{}.
template <class T>
std::vector<T> rearranged(const std::vector<T>& known, std::span<const std::uint32_t> before) {
  std::vector<T> out(before.size());
  for (std::size_t i = 0; i < before.size(); ++i)
    if (before[i] != kNewSegment) out[i] = known[before[i]];
  return out;
}

}  // namespace evpose
