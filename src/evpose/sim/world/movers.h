// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "evpose/core/pose.h"
#include "evpose/sim/world/scene.h"

namespace evpose {
class ConfigTable;
}

namespace evpose::sim {

class ClosedPath;
class MaterialLibrary;

/// Moving objects of a world, on the paths that it provides for them.
struct MoversConfig {
  int fans = 0;
  double fan_rpm = 240;
  int people = 0;
  double walk_m_s = 1.2;
  int cars = 0;
  double car_m_s = 6;
};
void describe(ConfigTable& table, MoversConfig& config);

struct MoverMaterials {
  std::vector<std::int32_t> cloths, paints;
  std::int32_t skin = 0, hair = 0, shoe = 0, glass = 0, tyre = 0, metal = 0, blade = 0;
};
MoverMaterials add_mover_materials(MaterialLibrary& library, std::uint64_t seed, double texel_m);

// Each is one object of the scene with one part for each rigid link. Motions are smooth (C^2) at all times.

struct Fan {
  std::string name = "fan";
  Pose T_map_fan;          ///< of the hub: it blows along x
  double radius_m = 0.35;  ///< of the blades
  int blades = 3;
  double rpm = 240;
  double phase = 0;          ///< rad at t = 0
  double stand_to_z = -1e9;  ///< height of the foot of its post, if below the hub
};
void add_fan(Scene& scene, const MoverMaterials& materials, const Fan& fan);

struct Walker {
  std::string name = "person";
  std::vector<Eigen::Vector3d> path;  ///< on the floor, closed, metres
  double speed_m_s = 1.2;
  double start_m = 0;      ///< along the path at t = 0
  double height_m = 1.75;  ///< of the head's top
  int clothes = 0;         ///< which of the materials
};
void add_walker(Scene& scene, const MoverMaterials& materials, const Walker& walker);

struct Car {
  std::string name = "car";
  std::vector<Eigen::Vector3d> path;  ///< on the ground, closed, metres
  double speed_m_s = 6;
  double start_m = 0;
  int paint = 0;
};
void add_car(Scene& scene, const MoverMaterials& materials, const Car& car);
/// The same car standing still: x ahead, z up, its wheels on z = 0.
void add_parked_car(Mesh& mesh, const MoverMaterials& materials, const Pose& T_map_car, int paint,
                    std::int32_t object);

}  // namespace evpose::sim
