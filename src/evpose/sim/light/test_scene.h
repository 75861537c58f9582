// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <numbers>

#include "evpose/camera/camera.h"
#include "evpose/sim/world/scene.h"

namespace evpose::sim {

/// Scenes of tests: plain rectangles in even light of pi lux, so that luminance is reflectance.
class TestScene {
 public:
  TestScene() {
    Light& light = scene.lights.emplace_back();
    light.name = "even";
    light.strength = std::numbers::pi;
    scene.objects.push_back("things");
  }

  /// A rectangle by a corner and two sides; its normal is the sides' cross product.
  void add(const Eigen::Vector3d& corner, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
           double reflectance) {
    add_to(scene.mesh, corner, a, b, material(reflectance));
  }
  int material(double reflectance) {
    scene.materials.push_back({"plain", reflectance, nullptr, 0, -1});
    return static_cast<int>(scene.materials.size()) - 1;
  }
  static void add_to(Mesh& mesh, const Eigen::Vector3d& corner, const Eigen::Vector3d& a,
                     const Eigen::Vector3d& b, int material) {
    const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
    const Eigen::Vector3f n = a.cross(b).normalized().cast<float>();
    for (const Eigen::Vector3d& p :
         {corner, Eigen::Vector3d(corner + a), Eigen::Vector3d(corner + a + b), Eigen::Vector3d(corner + b)})
      mesh.vertices.push_back(p.cast<float>());
    const auto u = static_cast<float>(a.norm()), v = static_cast<float>(b.norm());
    const std::array<Eigen::Vector2f, 4> uv = {Eigen::Vector2f(0, 0), Eigen::Vector2f(u, 0),
                                               Eigen::Vector2f(u, v), Eigen::Vector2f(0, v)};
    for (const auto& t : {std::array<std::uint32_t, 3>{0, 1, 2}, std::array<std::uint32_t, 3>{0, 2, 3}}) {
      mesh.triangles.push_back({first + t[0], first + t[1], first + t[2]});
      mesh.uv.push_back({uv[t[0]], uv[t[1]], uv[t[2]]});
      mesh.normals.push_back({n, n, n});
      mesh.material.push_back(material);
      mesh.object.push_back(0);
    }
  }
  /// A solid box that stands upright.
  static void add_box(Mesh& mesh, const Eigen::Vector3d& low, const Eigen::Vector3d& size, int material) {
    const Eigen::Vector3d x(size.x(), 0, 0), y(0, size.y(), 0), z(0, 0, size.z());
    add_to(mesh, low, y, x, material);
    add_to(mesh, low + z, x, y, material);
    add_to(mesh, low, x, z, material);
    add_to(mesh, low + y, z, x, material);
    add_to(mesh, low, z, y, material);
    add_to(mesh, low + x, y, z, material);
  }

  Scene scene;
};

/// Looks along +x of the map with y to the left; 60 degrees wide.
inline Pose looking_along_x(const Eigen::Vector3d& place) {
  Eigen::Matrix3d R;
  R << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  return {Eigen::Quaterniond(R), place};
}

inline std::shared_ptr<const Camera> test_camera(int width, int height, double focal_px) {
  return *make_camera(
      {focal_px, focal_px, 0.5 * (width - 1), 0.5 * (height - 1), "none", {}, {width, height}});
}

}  // namespace evpose::sim
