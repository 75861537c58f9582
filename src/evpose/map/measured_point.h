// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>

namespace evpose {

/// A point of a surface that several measurements have been averaged to.
struct MeasuredPoint {
  Eigen::Vector3d position;        ///< map frame, metres
  float sigma_m = 0;               ///< along the line of sight, 1 sigma
  std::uint32_t observations = 0;  ///< that it is the mean of
};

}  // namespace evpose
