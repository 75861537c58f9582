// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <functional>
#include <span>
#include <vector>

#include "evpose/core/error.h"
#include "evpose/event/event.h"
#include "evpose/map_learn/trajectory.h"
#include "evpose/run/track_recording.h"

namespace evpose::map_learn {

/// Of all pixels, row by row: the ray with z = 1, camera frame; zero: none, or not well ahead of the camera.
std::vector<Eigen::Vector3d> pixel_rays(const Camera& camera);
/// Half the width and height of what these rays see at depth 1.
Eigen::Vector2d largest_tangents(const std::vector<Eigen::Vector3d>& rays);

/// Takes the events of a short time, during which the image moves by less than 0.1 px, with the camera's
/// pose.
using TakePacket = std::function<void(TimeNs t, const Pose& T_map_cam, std::span<const Event> events)>;

/// The recording's events that lie within the trajectory, or every so manieth packet of them. `progress`: as
/// of feed_recording(). Error: of the recording.
Status for_each_packet(const TrackJob& job, const Trajectory& trajectory, int every,
                       const std::function<bool(double)>& progress, const TakePacket& take);

}  // namespace evpose::map_learn
