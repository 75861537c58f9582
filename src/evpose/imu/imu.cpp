// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/imu/imu.h"

#include <Eigen/LU>

namespace evpose {

ImuSample ImuAxes::corrected(const ImuSample& reading) const {
  if (are_ideal()) return reading;
  const Eigen::Vector3d force = accel.inverse() * reading.accel;
  return {reading.t, gyro.inverse() * (reading.gyro - gyro_by_force * force), force};
}

}  // namespace evpose
