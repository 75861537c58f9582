// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_build/tiles.h"

#include <algorithm>
#include <cmath>

#include "evpose/map/contour_map.h"
#include "evpose/map/point_cloud.h"

namespace evpose::map_build {
namespace {

constexpr double kLeastSide_m = 5;  // narrower tiles are not halved: their overlaps would be most of them

void halve(std::vector<Eigen::Vector2f>& sample, std::size_t begin, std::size_t end, double most,
           const CloudTile& tile, std::vector<CloudTile>& out) {
  const auto count = end - begin;
  Eigen::Vector2f low = count > 0 ? sample[begin] : Eigen::Vector2f::Zero(), high = low;
  for (std::size_t i = begin; i < end; ++i) low = low.cwiseMin(sample[i]), high = high.cwiseMax(sample[i]);
  const Eigen::Vector2f size = high - low;
  const Eigen::Index axis = size.x() >= size.y() ? 0 : 1;
  if (static_cast<double>(count) <= most || size[axis] < 2 * kLeastSide_m) {
    out.push_back(tile);
    return;
  }
  const std::size_t middle = begin + count / 2;
  std::nth_element(sample.begin() + static_cast<std::ptrdiff_t>(begin),
                   sample.begin() + static_cast<std::ptrdiff_t>(middle),
                   sample.begin() + static_cast<std::ptrdiff_t>(end),
                   [axis](const Eigen::Vector2f& a, const Eigen::Vector2f& b) { return a[axis] < b[axis]; });
  const float at = std::clamp(sample[middle][axis], low[axis] + static_cast<float>(kLeastSide_m),
                              high[axis] - static_cast<float>(kLeastSide_m));
  const auto beyond = std::partition(sample.begin() + static_cast<std::ptrdiff_t>(begin),
                                     sample.begin() + static_cast<std::ptrdiff_t>(end),
                                     [axis, at](const Eigen::Vector2f& p) { return p[axis] < at; });
  const auto split = static_cast<std::size_t>(beyond - sample.begin());
  CloudTile first = tile, second = tile;
  first.high[axis] = second.low[axis] = at;
  halve(sample, begin, split, most, first, out);
  halve(sample, split, end, most, second, out);
}

/// Every third bit of the result is one of the lower 21 of v.
std::uint64_t interleaved_with_zeros(std::uint64_t v) {
  v &= 0x1FFFFF;
  v = (v | v << 32) & 0x1F00000000FFFF;
  v = (v | v << 16) & 0x1F0000FF0000FF;
  v = (v | v << 8) & 0x100F00F00F00F00F;
  v = (v | v << 4) & 0x10C30C30C30C30C3;
  return (v | v << 2) & 0x1249249249249249;
}

}  // namespace

std::size_t sort_and_deduplicate(PointCloud& cloud) {
  constexpr float kCell_m = 0.05F;
  struct Place {
    std::uint64_t key;  ///< along a Z-curve
    std::uint32_t point;
  };
  if (cloud.points.empty()) return 0;
  Eigen::Vector3f low = cloud.points.front();
  for (const auto& p : cloud.points) low = low.cwiseMin(p);
  std::vector<Place> order(cloud.points.size());
  for (std::uint32_t i = 0; i < order.size(); ++i) {
    const Eigen::Vector3f cell = (cloud.points[i] - low) / kCell_m;
    const auto bits = [&](Eigen::Index k) {
      return interleaved_with_zeros(static_cast<std::uint64_t>(std::min(cell[k], 2'000'000.0F)));
    };
    order[i] = {bits(0) | bits(1) << 1 | bits(2) << 2, i};
  }
  std::sort(order.begin(), order.end(), [&](const Place& a, const Place& b) {
    if (a.key != b.key) return a.key < b.key;
    const Eigen::Vector3f &p = cloud.points[a.point], &q = cloud.points[b.point];
    if (p.x() != q.x()) return p.x() < q.x();
    if (p.y() != q.y()) return p.y() < q.y();
    if (p.z() != q.z()) return p.z() < q.z();
    return a.point < b.point;
  });
  std::vector<Eigen::Vector3f> points;
  std::vector<std::uint8_t> brightness;
  points.reserve(order.size());
  for (const auto& [key, i] : order) {
    if (!points.empty() && points.back() == cloud.points[i]) continue;
    points.push_back(cloud.points[i]);
    if (!cloud.brightness.empty()) brightness.push_back(cloud.brightness[i]);
  }
  const std::size_t dropped = order.size() - points.size();
  cloud.points = std::move(points);
  cloud.brightness = std::move(brightness);
  return dropped;
}

std::vector<CloudTile> cut_into_tiles(const std::vector<Eigen::Vector3f>& sample, std::size_t points,
                                      double most_points, double overlap_m) {
  constexpr float kFar = CloudTile::kNoBorder_m;
  const CloudTile all{Eigen::Vector2f(-kFar, -kFar), Eigen::Vector2f(kFar, kFar),
                      static_cast<float>(overlap_m)};
  if (static_cast<double>(points) <= most_points) return {all};
  std::vector<Eigen::Vector2f> places;
  for (const auto& p : sample) places.push_back(p.head<2>());
  const double share = static_cast<double>(sample.size()) / static_cast<double>(points);
  std::vector<CloudTile> out;
  halve(places, 0, places.size(), share * most_points, all, out);
  return out;
}

PointCloud points_seen_by(const PointCloud& cloud, const CloudTile& tile) {
  PointCloud out;
  out.anchor = cloud.anchor;
  out.source = cloud.source;
  for (std::size_t i = 0; i < cloud.points.size(); ++i) {
    if (!tile.holds(cloud.points[i], tile.overlap_m)) continue;
    out.points.push_back(cloud.points[i]);
    if (!cloud.brightness.empty()) out.brightness.push_back(cloud.brightness[i]);
  }
  return out;
}

std::optional<LineSegment> clipped(const LineSegment& segment, const CloudTile& tile) {
  double first = 0, last = 1;
  for (Eigen::Index axis = 0; axis < 2; ++axis) {
    const double from = segment.begin[axis], way = segment.end[axis] - from;
    const auto low = static_cast<double>(tile.low[axis]), high = static_cast<double>(tile.high[axis]);
    if (way == 0) {
      if (from < low || from >= high) return std::nullopt;
      continue;
    }
    const double to_low = (low - from) / way, to_high = (high - from) / way;
    first = std::max(first, std::min(to_low, to_high));
    last = std::min(last, std::max(to_low, to_high));
  }
  if (!(first < last)) return std::nullopt;
  LineSegment out = segment;
  out.begin = segment.begin + first * (segment.end - segment.begin);
  out.end = segment.begin + last * (segment.end - segment.begin);
  return out;
}

void append_tile(const ContourMap& tile, ContourMap& whole) {
  if (tile.points.empty() && tile.planes.empty()) return;
  const auto planes = static_cast<std::int32_t>(whole.planes.size());
  const auto polygons = static_cast<std::int32_t>(whole.polygons.size());
  const auto last = std::find_if(whole.points.rbegin(), whole.points.rend(),
                                 [](const ContourPoint& p) { return p.contour >= 0; });
  const std::int32_t contours = last == whole.points.rend() ? 0 : last->contour + 1;
  const auto moved = [](std::int32_t number, std::int32_t by) { return number < 0 ? number : number + by; };
  for (ContourPoint p : tile.points) {
    p.contour = moved(p.contour, contours);
    p.plane_a = moved(p.plane_a, planes);
    p.plane_b = moved(p.plane_b, planes);
    whole.points.push_back(p);
  }
  whole.planes.insert(whole.planes.end(), tile.planes.begin(), tile.planes.end());
  for (MapPolygon polygon : tile.polygons) {
    polygon.plane = moved(polygon.plane, planes);
    polygon.hole_of = moved(polygon.hole_of, polygons);
    whole.polygons.push_back(std::move(polygon));
  }
  whole.pages.push_back({static_cast<std::uint32_t>(whole.points.size()),
                         static_cast<std::uint32_t>(whole.planes.size()),
                         static_cast<std::uint32_t>(whole.polygons.size())});
}

}  // namespace evpose::map_build
