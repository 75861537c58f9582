// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/map_pager.h"

#include <algorithm>
#include <utility>

#include "evpose/map/visible_set.h"
#include "evpose/registration/rearranged.h"

namespace evpose {

std::vector<std::uint32_t> named_segments(const ContourMap& map, double length_m) {
  const ContourSegments segments = cut_into_segments(map, length_m);
  std::vector<std::uint32_t> name(segments.count, ~0U), out(map.points.size());
  for (std::uint32_t i = 0; i < out.size(); ++i) {
    std::uint32_t& least = name[segments.of_point[i]];
    least = std::min(least, map.number(i));
  }
  for (std::uint32_t i = 0; i < out.size(); ++i) out[i] = name[segments.of_point[i]];
  return out;
}

PreparedMap::PreparedMap(std::shared_ptr<const ContourMap> given, double offset_segment_m)
    : map(std::move(given)), index(*map), segments(cut_into_segments(*map)) {
  if (offset_segment_m > 0) offset_segments = named_segments(*map, offset_segment_m);
}

std::vector<bool> told_by_flights(const ContourMap& map, const ContourSegments& segments) {
  std::vector<bool> out(segments.count, false);
  for (std::size_t i = 0; i < map.points.size(); ++i)
    if (map.points[i].looks > 0 && map.points[i].kind != ContourKind::marking)
      out[segments.of_point[i]] = true;
  return out;
}

std::vector<int> contrast_of_segments(const ContourMap& map, const ContourSegments& segments) {
  std::vector<int> sum(segments.count, 0);
  for (std::size_t i = 0; i < map.points.size(); ++i) sum[segments.of_point[i]] += map.points[i].contrast;
  for (int& sign : sum) sign = (sign > 0) - (sign < 0);
  return sum;
}

NextMap followed(const PreparedMap& before, PreparedMap next) {
  NextMap out{std::move(next), {}, {}, {}};
  const ContourMap &old = *before.map, &now = *out.prepared.map;
  out.point_now.assign(old.points.size(), VisibleSet::kGone);
  out.segment_before.assign(out.prepared.segments.count, kNewSegment);
  for (std::uint32_t a = 0, b = 0; a < old.points.size() && b < now.points.size();) {
    if (old.number(a) == now.number(b)) {
      out.segment_before[out.prepared.segments.of_point[b]] = before.segments.of_point[a];
      out.point_now[a++] = b++;
    } else {
      ++(old.number(a) < now.number(b) ? a : b);
    }
  }
  out.contrast = contrast_of_segments(now, out.prepared.segments);
  return out;
}

std::unique_ptr<NextMap> MapPager::next(const Eigen::Vector3d& place_map, const PreparedMap& held,
                                        bool may_take) {
  if (!parts_) return nullptr;
  const double gone_m = (place_map - middle_).head<2>().norm();
  if (!job_.valid() && gone_m > kPrepare_m) {
    next_middle_ = place_map;
    job_ = std::async(std::launch::async, [this, &held]() -> std::unique_ptr<NextMap> {
      auto part = parts_(next_middle_, seen_m_ + kMargin_m);
      if (part == nullptr || part->points.empty()) return nullptr;
      return std::make_unique<NextMap>(followed(held, {std::move(part), offset_segment_m_}));
    });
  }
  if (!job_.valid() || gone_m <= kTake_m || !may_take) return nullptr;
  middle_ = next_middle_;
  return job_.get();
}

}  // namespace evpose
