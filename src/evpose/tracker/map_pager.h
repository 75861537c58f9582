// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <future>
#include <memory>
#include <optional>
#include <vector>

#include "evpose/map/contour_index.h"
#include "evpose/map/contour_segments.h"

namespace evpose {

/// The part of a map around a place (map frame) out to a horizontal distance at least; null if it cannot be
/// had. Called on a thread of its own.
using MapParts =
    std::function<std::shared_ptr<const ContourMap>(const Eigen::Vector3d& place_map, double radius_m)>;

/// The segment of each point, named by the lowest number of a point of it in the map as a whole: parts agree.
std::vector<std::uint32_t> named_segments(const ContourMap& map, double length_m);

/// A map, or a part of one, with what is made of it once.
struct PreparedMap {
  std::shared_ptr<const ContourMap> map;
  ContourIndex index;
  ContourSegments segments;  ///< for the contrast
  std::vector<std::uint32_t>
      offset_segments;  ///< of each point, named alike in every part; empty: not asked for

  /// `offset_segment_m`: length of the segments that have offsets, 0: none have.
  PreparedMap(std::shared_ptr<const ContourMap> given, double offset_segment_m);
};

/// A part of the map and how it follows from the one before.
struct NextMap {
  PreparedMap prepared;
  std::vector<std::uint32_t> point_now;       ///< of each point of the part before; VisibleSet::kGone
  std::vector<std::uint32_t> segment_before;  ///< of each contrast segment; kNewSegment
  std::vector<int> contrast;                  ///< that the map states of each segment
};

/// Of each segment, whether flights have told its place, and it is no marking: those have other edges like
/// them beside them.
std::vector<bool> told_by_flights(const ContourMap& map, const ContourSegments& segments);

/// The sign of contrast that most points of a segment state.
std::vector<int> contrast_of_segments(const ContourMap& map, const ContourSegments& segments);

/// How `next` follows from `before`, which are parts of one map.
NextMap followed(const PreparedMap& before, PreparedMap next);

/// Holds the part of a map around the camera: prepares another one on a thread of its own once the camera has
/// gone some way, and hands it over when it has gone further. When depends on the places alone.
class MapPager {
 public:
  static constexpr double kPrepare_m = 30, kTake_m = 40;  ///< from the middle of the part, horizontally
  /// What a part reaches beyond the distance that is seen: two ways to the next hand-over.
  static constexpr double kMargin_m = 2 * kTake_m;

  /// `seen_m`: how far contours are seen.
  MapPager(MapParts parts, const Eigen::Vector3d& middle, double seen_m, double offset_segment_m)
      : parts_(std::move(parts)), middle_(middle), seen_m_(seen_m), offset_segment_m_(offset_segment_m) {}

  /// To be asked once in each update. The part to use from now on, if it is time; `held`: the one in use,
  /// which stays as it is meanwhile; `may_take`: the tracker can change it now.
  std::unique_ptr<NextMap> next(const Eigen::Vector3d& place_map, const PreparedMap& held, bool may_take);

 private:
  MapParts parts_;
  Eigen::Vector3d middle_, next_middle_ = Eigen::Vector3d::Zero();
  double seen_m_, offset_segment_m_;
  std::future<std::unique_ptr<NextMap>> job_;
};

}  // namespace evpose
