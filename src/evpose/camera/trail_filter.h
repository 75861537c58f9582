// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <utility>

namespace evpose {

/// What a filter on the sensor keeps of a trail: events of one polarity at a pixel, each soon after the one
/// before.
enum class TrailFilterKind : std::uint8_t {
  none,          ///< all
  first,         ///< the first (vendor's TRAIL)
  second,        ///< the second (STC_CUT_TRAIL)
  all_but_first  ///< the second and what follows (STC_KEEP_TRAIL)
};

/// As configurations and calibration files name them.
inline constexpr std::array<std::pair<std::string_view, TrailFilterKind>, 4> kTrailFilters{
    {{"none", TrailFilterKind::none},
     {"first", TrailFilterKind::first},
     {"second", TrailFilterKind::second},
     {"all_but_first", TrailFilterKind::all_but_first}}};

constexpr std::string_view trail_filter_word(TrailFilterKind kind) {
  return kTrailFilters[static_cast<std::size_t>(kind)].first;
}

struct TrailFilterSetting {
  TrailFilterKind kind = TrailFilterKind::none;
  double longest_gap_s = 0.01;  ///< between the events of a trail
};

}  // namespace evpose
