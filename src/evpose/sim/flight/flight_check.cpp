// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/flight/flight_check.h"

#include <Eigen/Geometry>
#include <cmath>

#include "evpose/sim/light/panes.h"

namespace evpose::sim {
namespace {

constexpr double kStep_s = 5e-3;
constexpr float kNearest_m = 0.03F;

struct Surroundings {
  int behind = 0;  // directions in which the first surface shows its back
  int met = 0;
  float nearest = std::numeric_limits<float>::infinity();
};

Surroundings probe_surroundings(const RayCaster& rays, const Eigen::Vector3d& position) {
  Surroundings out;
  const Mesh& mesh = rays.scene().mesh;
  for (int x = -1; x <= 1; ++x) {
    for (int y = -1; y <= 1; ++y) {
      for (int z = -1; z <= 1; ++z) {
        if (x == 0 && y == 0 && z == 0) continue;
        // Not along the axes: rays in the plane of a wall meet its edges.
        const Eigen::Vector3d direction = Eigen::Vector3d(x + 0.013, y + 0.007, z + 0.019).normalized();
        const auto hit = rays.trace(position, direction);
        if (!hit) continue;
        ++out.met;
        out.nearest = std::min(out.nearest, hit->distance);
        if (mesh.normals[hit->triangle][0].cast<double>().dot(direction) > 0) ++out.behind;
      }
    }
  }
  return out;
}

}  // namespace

Status check_flight(const RayCaster& rays, const CameraPath& path, double duration_s, double focal_px,
                    double max_flow_px_s) {
  const int steps = std::max(1, static_cast<int>(std::ceil(duration_s / kStep_s)));
  for (int i = 0; i <= steps; ++i) {
    const double t_s = duration_s * i / steps;
    const CameraMotion motion = path(t_s);
    const Eigen::Vector3d& position = motion.T_map_cam.p;
    const auto where = [&] {
      return text("at ", t_s, " s, (", position.x(), ", ", position.y(), ", ", position.z(), ") m");
    };
    if (!position.allFinite())
      return Error{"trajectory", where() + ": not a number", "correct the trajectory"};
    Surroundings surroundings = probe_surroundings(rays, position);
    for (const Pane& pane : rays.scene().panes)
      surroundings.nearest = std::min(surroundings.nearest, static_cast<float>(distance(pane, position)));
    if (2 * surroundings.behind > surroundings.met)
      return Error{"trajectory", where() + ": the camera is inside of something", "move the trajectory"};
    if (surroundings.nearest < kNearest_m)
      return Error{
          "trajectory",
          where() + text(": the camera comes as near as ", 1e3 * surroundings.nearest, " mm to something"),
          "move the trajectory"};
    const double speed = focal_px * (motion.rate.norm() + motion.velocity.norm() / surroundings.nearest);
    if (speed > max_flow_px_s)
      return Error{"trajectory",
                   where() + text(": the image moves at ", std::round(speed),
                                  " px/s, more than integrator.max_flow_px_s"),
                   "fly slower, or raise the bound"};
  }
  return {};
}

}  // namespace evpose::sim
