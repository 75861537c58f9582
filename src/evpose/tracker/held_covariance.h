// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include "evpose/core/pose.h"

namespace evpose {

/// The covariance that is told of a pose in a map that states errors. A pose that has left its contours'
/// gates is held by the edges that it meets there: the filter takes them for the contours and states a
/// smaller covariance, while the error stays. What tells is that such events do not gather at the contours.
/// So a pose does not become better known than it was by events that do not gather.
class HeldCovariance {
 public:
  /// The pose comes from elsewhere, with an error of these sigmas that the filter knows nothing of.
  void restart(double position_m, double rotation_rad);
  /// At least `covariance`, which the filter states (position in the map frame, rotation in the body's, as
  /// Pose::plus); `concentration`: of the events in the gates, 0 where too few have come to tell.
  Matrix6d update(const Matrix6d& covariance, const Eigen::Quaterniond& q_map_body, double concentration,
                  double span_s);

 private:
  Matrix6d first_ = Matrix6d::Zero();  ///< beside the first covariance
  std::optional<Matrix6d> held_;       ///< both parts in the map frame
};

}  // namespace evpose
