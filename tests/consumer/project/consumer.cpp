// SPDX-License-Identifier: BSD-3-Clause
// What a user's own program does first: a camera, a map of one contour, a tracker that is fed and asked.
#include <cstdio>
#include <memory>

#include "evpose/camera/camera.h"
#include "evpose/core/version.h"
#include "evpose/map/contour_map.h"
#include "evpose/tracker/tracker.h"

using namespace evpose;

namespace {

std::shared_ptr<const ContourMap> line_in_front() {
  auto map = std::make_shared<ContourMap>();
  for (int i = -100; i <= 100; ++i) {
    ContourPoint point;
    point.position = {0.01F * static_cast<float>(i), 0, 2};
    point.normal = Eigen::Vector3f::UnitY();
    point.tangent = Eigen::Vector3f::UnitX();
    point.length = 0.01F;
    point.sigma = 0.002F;
    point.contour = 0;
    map->points.push_back(point);
  }
  return map;
}

}  // namespace

int main() {
  CameraIntrinsics intrinsics;
  intrinsics.fx = intrinsics.fy = 200;
  intrinsics.cx = 160;
  intrinsics.cy = 120;
  intrinsics.distortion_model = "none";
  intrinsics.size = {320, 240};
  const auto camera = make_camera(intrinsics);
  if (!camera) return std::puts(camera.error().line().c_str()), 1;

  TrackerSetup setup;
  setup.camera = *camera;
  setup.motion = MotionModel::constant_velocity;
  setup.map = line_in_front();
  StartState start;
  start.T_map_body.p = {0, -0.5, 0};  // the line is seen 50 px below the image's centre
  auto tracker = Tracker::create(setup, TrackerConfig{}, start);
  if (!tracker) return std::puts(tracker.error().line().c_str()), 1;

  // Structs with Eigen members cross the border in both directions: any disagreement about their layout shows
  // here.
  int updates = 0;
  bool at_start = true;
  (*tracker)->on_update([&](const Update& update) {
    ++updates;
    at_start =
        at_start && (update.T_map_body.p - start.T_map_body.p).norm() < 0.01 && update.covariance(5, 5) > 0;
  });
  EventPacket packet;
  for (std::uint32_t t_us = 0; t_us < 50'000; t_us += 10)
    packet.events.push_back(make_event(t_us, static_cast<int>(40 + t_us / 10 % 240), 170, true));
  (*tracker)->add_events(packet);
  std::printf("evpose %s: %d updates\n", version(), updates);
  return updates > 10 && at_start ? 0 : 1;
}
