// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/world/world_builder.h"

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

namespace evpose::sim {

std::int32_t WorldBuilder::add_object(const std::string& name) {
  scene.objects.push_back(name);
  return static_cast<std::int32_t>(scene.objects.size() - 1);
}

std::int32_t WorldBuilder::add_furniture(const std::string& name) {
  return scene.furniture.emplace_back(add_object(name));
}

Finish WorldBuilder::finish(std::int32_t material, std::int32_t object) {
  const double u = random.uniform(0, 4), v = random.uniform(0, 4);
  return {material, object, {u, v}};
}

void put_box(WorldBuilder& builder, const Placement& place, const Eigen::Vector3d& low,
             const Eigen::Vector3d& high, const Finish& finish, unsigned sides) {
  add_box(builder.scene.mesh, place.T_map_object * Pose{Eigen::Quaterniond::Identity(), 0.5 * (low + high)},
          high - low, finish, sides);
}

void put_sheet(WorldBuilder& builder, const Placement& place, const SheetOn& s, const Finish& finish) {
  const Pose& T = place.T_map_object;
  add_face(builder.scene.mesh,
           {T * Eigen::Vector3d(s.x, s.y - kPrintLift, s.z), T.q * Eigen::Vector3d(s.width, 0, 0),
            T.q * Eigen::Vector3d(0, 0, s.height)},
           finish);
}

void put_post(WorldBuilder& builder, const Eigen::Vector3d& foot, const Post& post, const Finish& finish,
              bool lids) {
  Cylinder cylinder;
  cylinder.radius_below = cylinder.radius_above = post.radius_m;
  cylinder.height = post.height_m;
  cylinder.facets = post.facets;
  cylinder.lid_below = false;
  cylinder.lid_above = lids;
  add_cylinder(builder.scene.mesh, {Eigen::Quaterniond::Identity(), foot}, cylinder, finish);
}

void add_daylight(WorldBuilder& builder) {
  const WorldConfig& c = builder.config;
  constexpr double kNightSkyLux = 0.3;  // between full moon and a town's glow
  const double azimuth = c.sun_azimuth_deg * std::numbers::pi / 180,
               elevation = c.sun_elevation_deg * std::numbers::pi / 180;
  Light sky;
  sky.name = "sky";
  sky.kind = LightKind::ambient;
  sky.daylight = true;
  sky.strength = c.night ? kNightSkyLux : c.sky_lux;
  if (!c.night) {
    Light sun;
    sun.name = "sun";
    sun.kind = LightKind::sun;
    sun.daylight = true;
    sun.strength = c.sun_lux;
    sun.radius = 4.65e-3;
    sun.direction = -Eigen::Vector3d(std::cos(elevation) * std::cos(azimuth),
                                     std::cos(elevation) * std::sin(azimuth), std::sin(elevation));
    builder.scene.lights.push_back(sun);
  }
  builder.scene.lights.push_back(sky);
  // Light from all of an even sky of luminance L is pi L on an open surface.
  builder.scene.sky_cd_m2 = sky.strength / std::numbers::pi;
}

double lamp_lux_at(const Scene& scene, const Eigen::Vector3d& point) {
  double lux = 0;
  for (const Light& light : scene.lights) {
    if (light.kind != LightKind::lamp) continue;
    const Eigen::Vector3d way = light.position - point;
    lux += light.strength * std::max(0.0, way.z()) / (way.norm() * way.squaredNorm());
  }
  return lux;
}

}  // namespace evpose::sim
