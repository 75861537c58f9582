// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <vector>

#include "evpose/fusion/state.h"
#include "evpose/map/visible_set.h"
#include "evpose/registration/contour_view.h"

namespace evpose {

/// The view-limited, occlusion-aware part of the map (EV-Pose 5.3), as samples for the registration.
class ContourSelection {
 public:
  /// `camera` projects the points; it may be corrected meanwhile. `choosing_camera`, which may not, decides
  /// which are in view. `map_sigma_m`: of contour points that state none. References are kept, but for the
  /// configuration.
  ContourSelection(const ContourIndex& index, const ContourSegments& segments, const Camera& camera,
                   const Camera& choosing_camera, const Pose& T_body_cam, const VisibleSetConfig& config,
                   double map_sigma_m, bool own_thread);

  /// The first choice of points is the dearest: made before the data come.
  void prepare(const Pose& T_map_body) { choose(T_map_body); }
  /// Chooses the points that the camera should see at this pose and near it.
  void choose(const Pose& T_map_body) { visible_.choose(T_map_body * T_body_cam_); }
  /// Projects the chosen points at this state over the last `span_s`.
  void project(const FusionState& state, double span_s);
  /// Moves the samples that project() made to where their contours are known to stand: each by
  /// `displacement_of(its point)`, map frame, m.
  template <class DisplacementOf>
  void displace(const DisplacementOf& displacement_of) {
    for (ContourSample& s : samples_) {
      const Eigen::Vector3d displacement = displacement_of(s.point);
      s.pixel += s.jacobian.head<3>().dot(displacement) * s.normal_px;
    }
  }
  /// By how much samples would move across their contours if the pose changed by this, px; the largest.
  double largest_shift_px(const Vector6d& pose_change) const;

  std::span<const ContourSample> samples() const { return samples_; }
  std::span<const std::uint32_t> points() const { return visible_.chosen(); }
  ContourView view() const { return {index_.map(), segments_, camera_, T_body_cam_, map_sigma_m_}; }
  /// See VisibleSet.
  bool choosing() const { return visible_.choosing(); }
  void renumber(std::span<const std::uint32_t> number_now) { visible_.renumber(number_now); }
  double typical_flow_px_s() const { return typical_flow_px_s_; }
  double typical_depth_m() const { return typical_depth_m_; }

 private:
  const ContourIndex& index_;
  const ContourSegments& segments_;
  const Camera& camera_;
  const Pose& T_body_cam_;
  double map_sigma_m_;
  VisibleSet visible_;
  std::vector<ContourSample> samples_;
  std::vector<double> flows_px_s_, depths_m_;  ///< of the samples
  double typical_flow_px_s_ = 0, typical_depth_m_ = 3;
};

}  // namespace evpose
