// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

namespace evpose {

/// Rows n, e, d of a frame whose x points east, y north and z up.
Eigen::Matrix3d rotation_ned_enu();

/// A place on the earth as degrees of latitude and longitude and m above the ellipsoid WGS84, in m along its
/// axes (EPSG 4978).
Eigen::Vector3d ecef_from_llh(const Eigen::Vector3d& llh);

/// A place in the north-east-down frame that is level at `origin_llh`, m.
Eigen::Vector3d ned_from_llh(const Eigen::Vector3d& llh, const Eigen::Vector3d& origin_llh);

}  // namespace evpose
