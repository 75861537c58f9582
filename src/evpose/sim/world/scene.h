// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "evpose/core/pose.h"

namespace evpose::sim {

class Texture;

/// Optical properties of a surface: Lambertian reflectance, own emission, a smooth clear coat.
struct Material {
  std::string name;
  double reflectance = 0.5;                ///< 0 to 1; a factor of the texture where there is one
  std::shared_ptr<const Texture> texture;  ///< none: plain
  double emission_cd_m2 = 0;               ///< emitted luminance: sky, lamp, window pane
  int emission_light = -1;                 ///< light whose switching and flicker it follows; -1: constant
  double mirror = 0;  ///< reflectance of the coat at normal incidence (polish, varnish, glass: 0.04); 0: matt
};

/// Triangles in the frame of their part, metres. Both sides are seen.
struct Mesh {
  using Corners = std::array<std::uint32_t, 3>;
  std::vector<Eigen::Vector3f> vertices;
  std::vector<Corners> triangles;
  std::vector<std::array<Eigen::Vector2f, 3>> uv;       ///< of each corner, metres on the texture
  std::vector<std::array<Eigen::Vector3f, 3>> normals;  ///< of each corner, unit, map's or part's frame
  std::vector<std::int32_t> material;                   ///< of each triangle
  std::vector<std::int32_t> object;  ///< of each triangle: number of its object in Scene::objects
};

/// Change of a light over time, as a factor; 1 without any.
struct LightSwitching {
  double off_at_s = -1;      ///< time from which `off_factor` holds; negative: never
  double on_at_s = -1;       ///< on again; negative: never
  double off_factor = 0;     ///< remaining fraction when off
  double flicker_hz = 0;     ///< of the light: twice the mains frequency
  double flicker_depth = 0;  ///< 0 to 1: factor 1 + depth * sin
  double fade_s = 2e-3;      ///< how long going off or on takes

  double factor(double t_s) const;
  /// Longest time step from `t_s` on, up to the next switch, over which the factor is nearly linear.
  double step_s(double t_s) const;
  double next_switch_s(double t_s) const;  ///< after `t_s`; infinite: none
  bool constant() const { return off_at_s < 0 && flicker_depth == 0; }
  bool operator==(const LightSwitching&) const = default;
};

enum class LightKind : std::uint8_t { sun, lamp, ambient };

struct Light {
  std::string name;
  LightKind kind = LightKind::ambient;
  /// sun: lux on a surface that faces it; lamp: candela; ambient: lux on an open surface
  double strength = 0;
  Eigen::Vector3d direction = -Eigen::Vector3d::UnitZ();  ///< sun: propagation of its light, map frame
  Eigen::Vector3d position = Eigen::Vector3d::Zero();     ///< lamp: metres, map frame
  double radius = 0.1;    ///< lamp: metres; sun: rad, half its apparent size. Sets the width of penumbrae
  bool daylight = false;  ///< from outdoors: not switched with the lamps
  LightSwitching switching;
};

/// A rigid body that moves, or one link of an articulated one.
struct MovingPart {
  std::string name;
  Mesh mesh;                                   ///< in the part's frame
  std::function<Pose(double t_s)> T_map_part;  ///< smooth; called from several threads
};

/// A flat rectangle of clear glass that is seen through and mirrors. It is no part of a mesh: light, the
/// LiDAR and contours pass it. Its rim should be in a frame.
struct Pane {
  Eigen::Vector3d corner, u, v;  ///< from `corner` along `u` and `v`, at right angles; metres, map frame
};

/// The environment of the sensors. Map frame: z up, metres.
struct Scene {
  std::string name;
  Mesh mesh;  ///< all static geometry, map frame
  std::vector<Material> materials;
  std::vector<Light> lights;
  std::vector<MovingPart> moving;
  std::vector<Pane> panes;
  std::vector<std::string> objects;     ///< names by Mesh::object; every moving object has its own number
  std::vector<std::int32_t> furniture;  ///< numbers of the static objects that people move about
  double sky_cd_m2 = 0;                 ///< luminance where a ray hits nothing
  Eigen::Vector3d low = Eigen::Vector3d::Zero();  ///< lower corner of the free space
  Eigen::Vector3d high = Eigen::Vector3d::Zero();
};

}  // namespace evpose::sim
