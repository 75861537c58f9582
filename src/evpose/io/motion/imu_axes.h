// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "evpose/core/error.h"
#include "evpose/core/pose.h"
#include "evpose/imu/imu.h"

namespace evpose {

/// How the axes of a sensor would have to be renamed: row i names what the true axis i is among those that
/// were read, one entry +-1 in each row and column.
using AxisNames = Eigen::Matrix3d;
/// "x is y, y is -x, z is z".
std::string in_words(const AxisNames& names);

/// The names with the least cost; of nearly equal ones those that change least.
struct AxisChoice {
  AxisNames names = AxisNames::Identity();
  double cost = 0, as_read = 0;
};
/// `cost`: positive, of each names.
AxisChoice choose_axes(const std::function<double(const AxisNames&)>& cost);
/// That a sensor's axes do not fit what `by` names, and which would.
Error wrong_axes(const std::string& where, const std::string& sensor, const std::string& by,
                 const AxisNames& names);

/// What the IMU alone says of its axes and units. Turned by the gyroscope, the mean specific force of half
/// seconds stays where it is, up to the acceleration of the flight; a gyroscope with swapped or mirrored
/// axes, or in deg/s, makes it whirl about. Told only where the true axes, or the unit, would explain far
/// more than what was read: most short or gentle flights tell nothing. Unset: no doubt.
std::optional<Error> doubt_gyro_by_gravity(const std::vector<ImuSample>& samples, const std::string& where);

/// By gravity the camera, which does not look steeply up or down, lies on its side or on its head: what
/// swapped and mirrored axes of both sensors make, or a rotation in T_cam_imu that is wrong. `R_cam_imu`:
/// turns the IMU's axes into the camera's (x right, y down, z forward).
std::optional<Error> doubt_camera_roll(const std::vector<ImuSample>& samples,
                                       const Eigen::Matrix3d& R_cam_imu, const std::string& where);

/// A mean specific force that is far from gravity's size though neither g nor free of gravity (ImuUnitCheck
/// tells those), or stamps of which no IMU has so many or so few in a second: another unit.
std::optional<Error> doubt_imu_scales(const std::vector<ImuSample>& samples, const std::string& where);

/// What a reference trajectory of the same body and clock says: the axes under which the gyroscope turns, and
/// the accelerometer shows up and the accelerations, as it does. At most one doubt for each sensor; none
/// where no axes would do, as with another clock.
std::vector<Error> doubt_axes_against(const std::vector<TimedPose>& reference,
                                      const std::vector<ImuSample>& samples, const std::string& where);

}  // namespace evpose
