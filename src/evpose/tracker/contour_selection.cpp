// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/contour_selection.h"

#include <algorithm>
#include <cmath>

namespace evpose {
namespace {

double median(std::vector<double>& values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

ContourSelection::ContourSelection(const ContourIndex& index, const ContourSegments& segments,
                                   const Camera& camera, const Camera& choosing_camera,
                                   const Pose& T_body_cam, const VisibleSetConfig& config, double map_sigma_m,
                                   bool own_thread)
    : index_(index),
      segments_(segments),
      camera_(camera),
      T_body_cam_(T_body_cam),
      map_sigma_m_(map_sigma_m),
      visible_(index, choosing_camera, config, own_thread) {}

double ContourSelection::largest_shift_px(const Vector6d& pose_change) const {
  double largest = 0;
  for (const ContourSample& s : samples_) largest = std::max(largest, std::abs(s.jacobian.dot(pose_change)));
  return largest;
}

void ContourSelection::project(const FusionState& state, double span_s) {
  const BodyMotion motion{state.nav.T_map_body, state.nav.velocity, state.angular_rate};
  project_contours(view(), visible_.chosen(), motion, span_s, samples_);
  const Eigen::Matrix3d velocity_covariance = state.covariance.block<3, 3>(error_state::kV, error_state::kV);
  const double rate_variance = state.covariance.block<3, 3>(error_state::kBg, error_state::kBg).trace() / 3;
  flows_px_s_.clear();
  depths_m_.clear();
  for (ContourSample& s : samples_) {
    const Eigen::Vector3d by_position = s.jacobian.head<3>();
    s.speed_sigma_px_s = std::sqrt(std::max(0.0, by_position.dot(velocity_covariance * by_position) +
                                                     rate_variance * s.jacobian.tail<3>().squaredNorm()));
    flows_px_s_.push_back(s.flow_px_s);
    depths_m_.push_back(s.depth_m);
  }
  if (!depths_m_.empty()) typical_depth_m_ = median(depths_m_);
  typical_flow_px_s_ = median(flows_px_s_);
}

}  // namespace evpose
