// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/core/geodesy.h"

#include <cmath>

namespace evpose {

Eigen::Matrix3d rotation_ned_enu() { return (Eigen::Matrix3d() << 0, 1, 0, 1, 0, 0, 0, 0, -1).finished(); }

Eigen::Vector3d ecef_from_llh(const Eigen::Vector3d& llh) {
  constexpr double kMajor_m = 6378137, kFlattening = 1 / 298.257223563;
  constexpr double kEccentricity2 = kFlattening * (2 - kFlattening), kRad = M_PI / 180;
  const double latitude = kRad * llh.x(), longitude = kRad * llh.y();
  const double across_m = kMajor_m / std::sqrt(1 - kEccentricity2 * std::pow(std::sin(latitude), 2));
  const double from_axis_m = (across_m + llh.z()) * std::cos(latitude);
  return {from_axis_m * std::cos(longitude), from_axis_m * std::sin(longitude),
          (across_m * (1 - kEccentricity2) + llh.z()) * std::sin(latitude)};
}

Eigen::Vector3d ned_from_llh(const Eigen::Vector3d& llh, const Eigen::Vector3d& origin_llh) {
  constexpr double kRad = M_PI / 180;
  const double sin_lat = std::sin(kRad * origin_llh.x()), cos_lat = std::cos(kRad * origin_llh.x());
  const double sin_lon = std::sin(kRad * origin_llh.y()), cos_lon = std::cos(kRad * origin_llh.y());
  Eigen::Matrix3d R_ned_ecef;
  R_ned_ecef << -sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat,  //
      -sin_lon, cos_lon, 0,                                       //
      -cos_lat * cos_lon, -cos_lat * sin_lon, -sin_lat;
  return R_ned_ecef * (ecef_from_llh(llh) - ecef_from_llh(origin_llh));
}

}  // namespace evpose
