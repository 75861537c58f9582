// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/fusion/segment_offsets.h"

#include <algorithm>
#include <cmath>

namespace evpose {

void SegmentOffsets::remove_all(ErrorStateFilter& filter) {
  // From the last one on, so that no other has to move.
  for (auto segment = segments_.rbegin(); segment != segments_.rend(); ++segment)
    filter.remove_block(segment->block);
  segments_.clear();
  place_of_number_.clear();
}

SegmentOffsets::Segment* SegmentOffsets::find_or_add(const ContourOffset& contour,
                                                     const Eigen::Vector3d& across_map,
                                                     ErrorStateFilter& filter) {
  const TimeNs now = filter.state().t;
  if (const auto known = place_of_number_.find(contour.segment); known != place_of_number_.end()) {
    Segment& segment = segments_[known->second];
    segment.seen = now;
    return &segment;
  }
  const double own_m = contour.sigma_m > 0 ? config_.sigma_m : config_.sigma_px / contour.across_body.norm();
  const Eigen::VectorXd sigma = Eigen::VectorXd::Constant(1, std::hypot(own_m, contour.sigma_m));
  std::size_t place = segments_.size();
  if (static_cast<int>(place) < config_.most) {
    segments_.push_back({contour.segment, filter.add_block(sigma), across_map, 0, now});
  } else {
    const auto oldest = std::min_element(segments_.begin(), segments_.end(),
                                         [](const Segment& a, const Segment& b) { return a.seen < b.seen; });
    constexpr double kGone_s = 0.2;  // a segment whose events pause for less is still in view
    if (oldest == segments_.end() || to_seconds(now - oldest->seen) < kGone_s) return nullptr;
    place = static_cast<std::size_t>(oldest - segments_.begin());
    place_of_number_.erase(oldest->number);
    *oldest = {contour.segment, oldest->block, across_map, 0, now};
    filter.reset_block(oldest->block, sigma);
  }
  place_of_number_[contour.segment] = place;
  return &segments_[place];
}

std::optional<BlockRow> SegmentOffsets::row_of(const ContourOffset& contour, ErrorStateFilter& filter) {
  const Eigen::Vector3d across = filter.state().nav.T_map_body.rotation() * contour.across_body;
  const double length = across.norm();
  const Segment* segment = length > 0 ? find_or_add(contour, across / length, filter) : nullptr;
  if (segment == nullptr) return std::nullopt;
  // The contour's point moves against the pose and with the segment.
  return BlockRow{segment->block, BlockRow::Derivative::Constant(1, -across.dot(segment->across_map))};
}

Eigen::Vector3d SegmentOffsets::displacement_of(std::uint32_t segment) const {
  const auto known = place_of_number_.find(segment);
  if (known == place_of_number_.end()) return Eigen::Vector3d::Zero();
  const Segment& found = segments_[known->second];
  return found.offset_m * found.across_map;
}

void SegmentOffsets::apply_corrections(const ErrorStateFilter& filter) {
  for (Segment& segment : segments_) segment.offset_m += filter.correction(segment.block)(0);
}

}  // namespace evpose
