// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "evpose/core/error.h"
#include "evpose/imu/imu.h"
#include "evpose/map/contour_map.h"
#include "evpose/tracker/tracker.h"

namespace evpose {

// What looks wrong with the input although it can be tracked: the first thing to look at when a run goes
// wrong. Unset: nothing.

/// A map whose size suggests another unit than metres.
std::optional<Error> doubt_map_size(const ContourMap& map);

/// A start outside of the box that holds the map; across a map that is flat, any distance will do.
std::optional<Error> doubt_start_place(const ContourMap& map, const Pose& T_map_body);

/// Up by the accelerometer: the mean of the half second from `t` on, turned by the gyroscope to its
/// beginning; unit vector, body frame. Unset: too few samples, or free fall.
std::optional<Eigen::Vector3d> up_by_accelerometer(const std::vector<ImuSample>& samples, TimeNs t);

/// A start at which the first half second of the accelerometer, turned into the map, does not show up.
/// `where` names the IMU.
std::optional<Error> doubt_start_attitude(const std::vector<ImuSample>& samples, const StartState& start,
                                          const std::string& where);

/// Everything that can be said of the IMU: its start's attitude, scales, and axes, against the ground truth
/// where there is one.
std::vector<Error> doubt_imu(const std::vector<ImuSample>& samples, const std::vector<TimedPose>& truth,
                             const StartState& start, const std::string& where);

}  // namespace evpose
