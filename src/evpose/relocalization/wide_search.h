// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/event/event_preprocessor.h"
#include "evpose/map/visible_set.h"
#include "evpose/registration/edge_field.h"
#include "evpose/registration/pose_search.h"
#include "evpose/relocalization/attitude_search.h"
#include "evpose/relocalization/edge_lines.h"
#include "evpose/relocalization/place_cache.h"

namespace evpose {

/// What is known before a search over metres and any heading.
struct WidePrior {
  Pose T_map_body;
  Matrix6d covariance;      ///< of the pose, as Pose::plus
  Eigen::Vector3d up_body;  ///< specific force: only about upwards while the vehicle accelerates
};

/// Finds poses anywhere in a map: attitudes by the directions of the image's lines, then positions with each
/// of them by where these lines are, then both together by the distances of contours to edges.
class WideSearch {
 public:
  /// A prior by which contours may be far off in the image is searched here: the guesses of search_pose() are
  /// too few.
  static bool suits(const Matrix6d& covariance);

  /// The references outlive it.
  WideSearch(const ContourIndex& index, const Camera& camera, const VisibleSetConfig& visible,
             PlaceCache& places);

  /// Makes what depends on the map and the prior's place alone, unless the cache has it: seconds.
  void prepare(const WidePrior& prior);
  /// Poses that differ, best first, at most sixteen. `events`: of some 10 to 30 ms, without rotation; `field`
  /// is of the same.
  std::vector<PoseGuess> find(std::span<const FilteredEvent> events, const EdgeField& field,
                              const Pose& T_body_cam, const WidePrior& prior);

 private:
  Eigen::AlignedBox3d box(const WidePrior& prior) const;
  void see_from_nearest_place(const Pose& T_map_cam);
  void see_from(const Pose& T_map_cam);
  PoseGuess refine(const EdgeField& field, const Pose& T_body_cam, const PoseGuess& guess,
                   double from_px) const;

  const ContourIndex& index_;
  const Camera& camera_;
  VisibleSetConfig visible_config_;
  Eigen::AlignedBox3d space_;
  std::vector<MapDirection> directions_;
  EdgeLineFinder line_finder_;
  VisibleSet visible_;
  PlaceCache& cache_;
  std::shared_ptr<const PlaceIndex> places_;
  Eigen::AlignedBox3d places_box_;
  std::vector<SearchPoint> points_;  ///< in view
};

}  // namespace evpose
