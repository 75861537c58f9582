// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/bench/micro/scene.h"

#include <algorithm>
#include <random>

namespace evpose::bench {
namespace {

constexpr double kStep_m = 0.01;
constexpr double kContourShare = 0.4;  // of the events; as measured on recordings, texture makes the most

void add_edge(ContourMap& map, const Eigen::Vector3d& a, const Eigen::Vector3d& b, std::int32_t contour) {
  const double length = (b - a).norm();
  const Eigen::Vector3d t = (b - a) / length;
  for (double s = 0; s < length; s += kStep_m) {
    ContourPoint p;
    p.position = (a + s * t).cast<float>();
    p.tangent = t.cast<float>();
    p.normal = t.unitOrthogonal().cast<float>();
    p.length = static_cast<float>(kStep_m);
    p.contour = contour;
    map.points.push_back(p);
  }
}

void add_box(ContourMap& map, const Eigen::Vector3d& low, const Eigen::Vector3d& high) {
  const auto corner = [&](int k) {
    return Eigen::Vector3d((k & 1) != 0 ? high.x() : low.x(), (k & 2) != 0 ? high.y() : low.y(),
                           (k & 4) != 0 ? high.z() : low.z());
  };
  for (int k = 0; k < 8; ++k)
    for (const int bit : {1, 2, 4})
      if ((k & bit) == 0)
        add_edge(map, corner(k), corner(k | bit), static_cast<std::int32_t>(map.points.size()));
  const auto first = static_cast<std::uint32_t>(map.occluders.vertices.size());
  for (int k = 0; k < 8; ++k) map.occluders.vertices.push_back(corner(k).cast<float>());
  for (const auto& f : {std::array<std::uint32_t, 4>{0, 1, 3, 2},
                        {4, 5, 7, 6},
                        {0, 1, 5, 4},
                        {2, 3, 7, 6},
                        {0, 2, 6, 4},
                        {1, 3, 7, 5}}) {
    map.occluders.triangles.push_back({first + f[0], first + f[1], first + f[2]});
    map.occluders.triangles.push_back({first + f[0], first + f[2], first + f[3]});
  }
}

}  // namespace

Scene make_scene(int width, int height) {
  Scene scene;
  const double f = 0.6 * width;
  scene.camera = std::move(make_camera({f,
                                        f,
                                        0.5 * (width - 1),
                                        0.5 * (height - 1),
                                        "radtan",
                                        {-0.1, 0.02, 5e-4, -3e-4},
                                        {width, height}}))
                     .value();
  std::mt19937 random(12);
  std::uniform_real_distribution<double> u(0, 1);
  add_box(scene.map, {0, 0, 0}, {8, 6, 3});
  for (int i = 0; i < 60; ++i) {
    const Eigen::Vector3d size(0.1 + 0.8 * u(random), 0.1 + 0.8 * u(random), 0.05 + 0.9 * u(random));
    const Eigen::Vector3d low(3 + 4 * u(random), 5 * u(random), 2 * u(random));
    add_box(scene.map, low, low + size);
  }
  Eigen::Matrix3d R;  // z forward along the map's x, x right along -y, y down along -z
  R << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  scene.T_map_cam = {Eigen::Quaterniond(R), {0.8, 3, 1.5}};
  return scene;
}

void repeat_room(ContourMap& map, int rooms) {
  const std::vector<ContourPoint> room = map.points;
  constexpr int kRow = 16;
  for (int i = 1; i < rooms; ++i) {
    const Eigen::Vector3f shift(10.0F * static_cast<float>(i % kRow), 8.0F * static_cast<float>(i / kRow), 0);
    for (ContourPoint p : room) {
      p.position += shift;
      p.contour += static_cast<std::int32_t>(room.size()) * i;
      map.points.push_back(p);
    }
  }
}

EventPacket make_events(const Scene& scene, std::size_t count, double span_s) {
  std::vector<Eigen::Vector2d> seen;
  const Pose T_cam_map = scene.T_map_cam.inverse();
  const ImageSize size = scene.camera->size();
  for (std::size_t i = 0; i < scene.map.points.size(); ++i) {
    const auto pixel = scene.camera->project(T_cam_map * scene.map.position(i));
    if (pixel && size.contains(*pixel)) seen.push_back(*pixel);
  }
  std::mt19937 random(5);
  std::uniform_real_distribution<double> u(0, 1);
  std::vector<std::uint32_t> times(count);
  for (auto& t : times) t = static_cast<std::uint32_t>(u(random) * span_s * 1e6);
  std::sort(times.begin(), times.end());
  EventPacket packet;
  for (const std::uint32_t t : times) {
    Eigen::Vector2d x(u(random) * (size.width - 1), u(random) * (size.height - 1));
    if (u(random) < kContourShare)
      x = seen[static_cast<std::size_t>(u(random) * static_cast<double>(seen.size() - 1))] +
          Eigen::Vector2d(2 * u(random) - 1, 2 * u(random) - 1);
    const int px = std::clamp(static_cast<int>(std::lround(x.x())), 0, size.width - 1);
    const int py = std::clamp(static_cast<int>(std::lround(x.y())), 0, size.height - 1);
    packet.events.push_back(make_event(t, px, py, u(random) < 0.5));
  }
  return packet;
}

}  // namespace evpose::bench
