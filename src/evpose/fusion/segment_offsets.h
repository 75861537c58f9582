// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <unordered_map>
#include <vector>

#include "evpose/fusion/error_state_filter.h"
#include "evpose/fusion/fusion_config.h"

namespace evpose {

/// Offsets of single map segments as states of a filter: a segment stands elsewhere than the map says, or
/// texture that moves with it is taken for it. An offset is one length, along the direction in the map across
/// which the segment was seen first; with a view from elsewhere it counts by the cosine. Offsets do not
/// change while a segment is in view; when there are more segments than states, the one not seen for longest
/// gives way, and what finds no state does not count.
class SegmentOffsets {
 public:
  explicit SegmentOffsets(const SegmentOffsetConfig& config) : config_(config) {}

  void remove_all(ErrorStateFilter& filter);
  /// How a contour's residual, measured where the segment is known to stand, depends on the error of the
  /// segment's offset. A segment that is seen for the first time becomes a state. None: there is no state for
  /// it.
  std::optional<BlockRow> row_of(const ContourOffset& contour, ErrorStateFilter& filter);
  /// From where the map has the segment, map frame.
  Eigen::Vector3d displacement_of(std::uint32_t segment) const;
  /// Takes over what the filter's last update found.
  void apply_corrections(const ErrorStateFilter& filter);

  struct Segment {
    std::uint32_t number = 0;
    BlockId block{};
    Eigen::Vector3d across_map;  ///< unit
    double offset_m = 0;
    TimeNs seen = 0;
  };
  const std::vector<Segment>& segments() const { return segments_; }

 private:
  /// The contour's segment; null: there is no state for it.
  Segment* find_or_add(const ContourOffset& contour, const Eigen::Vector3d& across_map,
                       ErrorStateFilter& filter);

  SegmentOffsetConfig config_;
  std::vector<Segment> segments_;
  std::unordered_map<std::uint32_t, std::size_t> place_of_number_;  ///< in segments_
};

}  // namespace evpose
