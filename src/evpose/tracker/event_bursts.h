// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "evpose/event/event_preprocessor.h"

namespace evpose {

/// Events of half a millisecond.
constexpr std::uint32_t kEventSlice_us = 500;
/// One behind the last event of each such slice. Events in the order of time.
std::vector<std::size_t> slice_ends(std::span<const FilteredEvent> events);
/// The pixels of a slice, of more than a few events, become all brighter or all darker; where something
/// moves, some do the one and some the other.
bool changes_as_a_whole(std::span<const FilteredEvent> slice);

/// Tells the slices in which light changes all over the image: lamps flicker, each time with a burst of
/// events of all pixels, and between two bursts, where the light turns over, only what moves makes events.
class EventBursts {
 public:
  /// Those of the events that come in no burst, as the slices of these and of former calls say.
  std::span<const FilteredEvent> quiet(std::span<const FilteredEvent> events);

 private:
  static constexpr std::size_t kSlices = 32;  ///< that are remembered: of 0.06 to 0.2 s, as looks are apart
  std::size_t quiet_count() const;

  std::array<std::size_t, kSlices> counts_{};
  std::size_t seen_ = 0;
  std::vector<FilteredEvent> quiet_;
};

}  // namespace evpose
