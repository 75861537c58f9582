// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "evpose/core/pose.h"
#include "evpose/sim/world/scene.h"

namespace evpose::sim {

/// Material, texture offset and object of a face.
struct Finish {
  std::int32_t material = 0;
  std::int32_t object = 0;
  Eigen::Vector2d uv = Eigen::Vector2d::Zero();  ///< texture coordinates of the face's first corner, metres
  bool along_grain = false;                      ///< the texture's u runs along each face's longer side
};

/// A parallelogram from `corner` along `u` and `v`, metres. Its outside is where u x v points; the texture's
/// u runs along u, its v across it, both in metres on the surface.
struct Face {
  Eigen::Vector3d corner, u, v;
};
void add_face(Mesh& mesh, const Face& face, const Finish& finish);

/// Sides of a box, or'ed.
enum BoxSides : unsigned {
  side_west = 1,   ///< -x
  side_east = 2,   ///< +x
  side_south = 4,  ///< -y
  side_north = 8,  ///< +y
  side_below = 16,
  side_above = 32,
  all_sides = 63
};
/// A box of `size` metres, its middle at T_part_box's origin. The texture stands upright on the upright sides
/// and begins elsewhere on each side.
void add_box(Mesh& mesh, const Pose& T_part_box, const Eigen::Vector3d& size, const Finish& finish,
             unsigned sides = all_sides);
/// A box whose floor's middle is at `foot`, turned about z.
void add_box_on(Mesh& mesh, const Eigen::Vector3d& foot, const Eigen::Vector3d& size, double yaw,
                const Finish& finish, unsigned sides = all_sides);
/// The box between two corners, upright.
void add_box_between(Mesh& mesh, const Eigen::Vector3d& low, const Eigen::Vector3d& high,
                     const Finish& finish, unsigned sides = all_sides);

/// A round body along z of `T_part_axis` from z = 0 to `height`, closed by lids; a cone where the radii
/// differ.
struct Cylinder {
  double radius_below = 0.1, radius_above = 0.1, height = 1;  // metres
  int facets = 32;
  bool lid_below = true, lid_above = true;
};
void add_cylinder(Mesh& mesh, const Pose& T_part_axis, const Cylinder& cylinder, const Finish& finish);

/// A flat ring in the plane z = 0 of `T_part_ring` that faces +z; its texture lies in x and y.
struct Ring {
  double inner, outer;  // radii, metres
  int facets;
};
void add_ring(Mesh& mesh, const Pose& T_part_ring, const Ring& ring, const Finish& finish);

/// A rectangle left out of a wall: metres along the wall's u and v.
struct Opening {
  double u0, u1, v0, v1;
};
/// A rectangular face with rectangular openings that do not overlap; around each, faces go `reveal_m` deep to
/// the inside. The face is cut along the openings' lines throughout, so that no corner lies within an edge.
void add_wall(Mesh& mesh, const Face& face, const std::vector<Opening>& openings, double reveal_m,
              const Finish& finish, const Finish& reveal);

/// How far a print lies over what it is stuck to, metres: too thin to be a contour, thick enough for rays.
inline constexpr double kPrintLift = 0.6e-3;
/// A thin sheet over a face: the rectangle `at` of it.
void add_print(Mesh& mesh, const Face& face, const Opening& at, const Finish& finish);

/// All of `other`, moved.
void add_mesh(Mesh& mesh, const Mesh& other, const Pose& T_mesh_other);

/// Unit normal of a triangle by its corners' order; zero for a degenerate one.
Eigen::Vector3d triangle_normal(const Mesh& mesh, std::size_t triangle);

}  // namespace evpose::sim
