// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/core/pose.h"
#include "evpose/event/event.h"
#include "evpose/map/contour_map.h"

namespace evpose::bench {

/// A room of 8 x 6 x 3 m full of boxes, seen by a camera that moves through it: a load like that of a real
/// recording, the same at every run.
struct Scene {
  std::shared_ptr<const Camera> camera;
  ContourMap map;
  Pose T_map_cam;                                ///< of a view along the room
  Eigen::Vector3d velocity{0.5, 0.4, 0.1};       ///< map frame, m/s
  Eigen::Vector3d angular_rate{0.05, 0.2, 0.1};  ///< camera frame, rad/s
};

/// `width` x `height` of the image, with the same field of view for any.
Scene make_scene(int width, int height);

/// Makes a building of so many such rooms beside each other, 10 x 8 m each, without more occluders.
void repeat_room(ContourMap& map, int rooms);

/// `count` events over `span_s`: most near the projected contours, the rest anywhere, as from texture and
/// noise.
EventPacket make_events(const Scene& scene, std::size_t count, double span_s);

}  // namespace evpose::bench
