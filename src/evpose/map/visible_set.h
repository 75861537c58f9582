// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <future>
#include <optional>
#include <span>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/core/pose.h"
#include "evpose/map/contour_index.h"
#include "evpose/map/depth_buffer.h"

namespace evpose {

class ConfigTable;

struct VisibleSetConfig {
  double far_m = 40;      ///< points further away are left out
  double stride_px = 6;   ///< least distance of two points along one contour, in the image
  int budget = 6000;      ///< most points in all
  bool occlusion = true;  ///< leave out points behind the map's occluders, if it has any

  // Not for users: the relocalizer and tests differ in these. Lengths hold for an image 640 wide.
  double near_m = 0.1;     ///< points nearer are left out: no camera is sharp there
  double margin_px = 20;   ///< points may lie this far outside of the image when chosen
  double refresh_px = 16;  ///< chosen again before the view has moved by this much: less than the margin
  int updates = 6;         ///< that a choice takes at least, but for fast motion
  double grazing_sin =
      0.17;  ///< contours seen at a smaller sine of the angle to the line of sight are left out
};
void describe(ConfigTable& table, VisibleSetConfig& config);

/// The points to align: inside the frustum, not hidden, evenly along every contour, the same from update to
/// update until the view has moved (EV-Pose 5.3, "view-limited, occlusion-aware").
class VisibleSet {
 public:
  /// `background`: points are chosen on a thread of their own.
  VisibleSet(const ContourIndex& index, const Camera& camera, const VisibleSetConfig& config,
             bool background = false);

  /// Point numbers of the map for a pose at most `refresh_px` from this one. They are chosen anew in slices
  /// over several calls, or meanwhile on another thread, so that no call takes long; which, and from which
  /// call on, depends on the poses of the calls and nothing else.
  const std::vector<std::uint32_t>& choose(const Pose& T_map_cam);

  /// As of the last call of choose().
  const std::vector<std::uint32_t>& chosen() const { return points_; }
  /// A choice is under way, which knows the index as it is.
  bool choosing() const { return calls_left_ > 0; }
  /// The index is that of another part of the map from now on: each chosen point has got this number, kGone
  /// if it is not in it. Not while choosing.
  static constexpr std::uint32_t kGone = ~0U;
  void renumber(std::span<const std::uint32_t> number_now);

 private:
  double moved_px(const Pose& from, const Pose& to) const;
  int updates_for_choice(double step_px) const;
  void begin_choice(const Pose& T_map_cam, int updates);
  /// Does what is left of the choice under way, and takes it.
  void complete_choice();
  void list_candidates(const Pose& T_map_cam);
  /// Draws and examines so many triangles and points, or a few more.
  void examine(std::size_t most);
  std::uint32_t end_of_examined(const ContourIndex::Cube& cube) const;
  void keep_if_visible(std::uint32_t number);
  void keep_to_budget();
  double near_distance_m();
  bool outside_cone(const Eigen::Vector3f& centre_cam, float radius) const;
  bool has_chosen_neighbour(const Eigen::Vector2f& u, const Eigen::Vector2f& t) const;
  std::size_t cell_of(const Eigen::Vector2f& pixel) const;

  const ContourIndex& index_;
  const Camera& camera_;
  VisibleSetConfig config_;
  bool background_;
  float cone_cos_, cone_sin_;  ///< of the cone around the optical axis that holds the image
  std::vector<std::uint32_t> points_;
  Pose T_map_cam_;     ///< of points_
  double near_m_ = 0;  ///< distance of the nearer ones of points_
  bool chosen_once_ = false;
  std::optional<Pose> last_;  ///< of the last call

  // The choice under way.
  int calls_left_ = 0;  ///< until it is taken, 0: none is under way
  Pose next_T_map_cam_;
  double next_near_m_ = 0;
  std::vector<double> distances_m_;
  bool finished_ = false;
  Eigen::Matrix3f R_cam_map_;
  Eigen::Vector3f offset_;  ///< of the map's anchor, camera frame
  std::size_t effort_ = 0;  ///< that it took so far, or that the last one took
  DepthBuffer depth_;
  std::vector<std::uint32_t> occluders_, cubes_;  ///< in view, what is left to examine
  std::size_t occluders_done_ = 0, cubes_done_ = 0, remaining_ = 0;
  std::vector<std::uint32_t> next_points_;
  /// A chosen point in the grid of `stride_px` cells that finds its neighbours along the contour.
  struct Chosen {
    Eigen::Vector2f pixel, direction;
    std::int32_t next;  ///< of the same cell, -1: none
  };
  int columns_, rows_;
  std::vector<std::int32_t> cells_;
  std::vector<Chosen> chosen_;
  std::future<void> job_;  ///< uses all of the above
};

}  // namespace evpose
