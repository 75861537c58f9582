// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/world/mesh_builder.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

namespace evpose::sim {
namespace {

const Pose kTilted{so3::exp({0.3, -0.5, 1.1}), {1, -2, 0.5}};

double area(const Mesh& mesh) {
  double sum = 0;
  for (const auto& t : mesh.triangles) {
    const Eigen::Vector3d a = mesh.vertices[t[0]].cast<double>(), b = mesh.vertices[t[1]].cast<double>(),
                          c = mesh.vertices[t[2]].cast<double>();
    sum += 0.5 * (b - a).cross(c - a).norm();
  }
  return sum;
}

// Volume by the divergence theorem: right only for closed surfaces whose triangles all turn outwards.
double volume(const Mesh& mesh) {
  double sum = 0;
  for (const auto& t : mesh.triangles) {
    const Eigen::Vector3d a = mesh.vertices[t[0]].cast<double>(), b = mesh.vertices[t[1]].cast<double>(),
                          c = mesh.vertices[t[2]].cast<double>();
    sum += a.dot(b.cross(c)) / 6;
  }
  return sum;
}

// Lengths on the texture are lengths on the surface, mirrored nowhere; corner normals are near the
// triangle's.
void expect_sound(const Mesh& mesh, double smooth_cosine) {
  ASSERT_EQ(mesh.uv.size(), mesh.triangles.size());
  ASSERT_EQ(mesh.normals.size(), mesh.triangles.size());
  ASSERT_EQ(mesh.material.size(), mesh.triangles.size());
  ASSERT_EQ(mesh.object.size(), mesh.triangles.size());
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    const auto& t = mesh.triangles[i];
    const Eigen::Vector3f ab = mesh.vertices[t[1]] - mesh.vertices[t[0]],
                          ac = mesh.vertices[t[2]] - mesh.vertices[t[0]];
    const Eigen::Vector2f ab_uv = mesh.uv[i][1] - mesh.uv[i][0], ac_uv = mesh.uv[i][2] - mesh.uv[i][0];
    EXPECT_GT(0.5 * ab.cross(ac).norm(), 1e-8);
    EXPECT_NEAR(ab.norm(), ab_uv.norm(), 0.01 * ab.norm());
    EXPECT_NEAR(ac.norm(), ac_uv.norm(), 0.01 * ac.norm());
    EXPECT_NEAR(ab_uv.x() * ac_uv.y() - ab_uv.y() * ac_uv.x(), ab.cross(ac).norm(),
                0.02 * ab.cross(ac).norm());
    for (const auto& n : mesh.normals[i])
      EXPECT_GT(n.cast<double>().dot(triangle_normal(mesh, i)), smooth_cosine);
  }
}

TEST(MeshBuilder, ABoxIsClosedAndOutwards) {
  Mesh mesh;
  add_box(mesh, kTilted, {1, 2, 3}, {});
  EXPECT_NEAR(volume(mesh), 6, 1e-4);
  EXPECT_NEAR(area(mesh), 22, 1e-4);
  expect_sound(mesh, 0.9999);
}

TEST(MeshBuilder, SidesLeftOutAreTheNamedOnes) {
  Mesh mesh;
  add_box_on(mesh, {0, 0, 0}, {1, 1, 1}, 0.2, {}, all_sides & ~static_cast<unsigned>(side_below));
  EXPECT_NEAR(area(mesh), 5, 1e-5);
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) EXPECT_GT(triangle_normal(mesh, i).z(), -0.1);
}

TEST(MeshBuilder, ACylinderApproachesItsVolume) {
  Mesh mesh;
  Cylinder cylinder;
  cylinder.radius_below = 0.5;
  cylinder.radius_above = 0.5;
  cylinder.height = 2;
  cylinder.facets = 64;
  add_cylinder(mesh, kTilted, cylinder, {});
  // A regular prism of 64 sides.
  EXPECT_NEAR(volume(mesh), 2 * 0.5 * 64 * 0.25 * std::sin(2 * std::numbers::pi / 64), 1e-5);
  expect_sound(mesh, std::cos(0.06));
}

TEST(MeshBuilder, AConeApproachesAThird) {
  Mesh mesh;
  Cylinder cone;
  cone.radius_below = 0.4;
  cone.radius_above = 0;
  cone.height = 1.5;
  cone.facets = 48;
  add_cylinder(mesh, kTilted, cone, {});
  EXPECT_NEAR(volume(mesh), 1.5 / 3 * 0.5 * 48 * 0.16 * std::sin(2 * std::numbers::pi / 48), 1e-5);
}

TEST(MeshBuilder, AWallLosesItsOpeningsAndGainsReveals) {
  const Face wall{{0, 0, 0}, {6, 0, 0}, {0, 0, 3}};
  const std::vector<Opening> openings = {{1, 2, 1, 2}, {3, 4.5, 0.8, 2.2}};
  Mesh bare, deep;
  add_wall(bare, wall, openings, 0, {}, {});
  EXPECT_NEAR(area(bare), 18 - 1 - 2.1, 1e-5);
  add_wall(deep, wall, openings, 0.2, {}, {});
  EXPECT_NEAR(area(deep) - area(bare), 0.2 * (4 + 5.8), 1e-5);
  expect_sound(deep, 0.9999);
}

// Every corner that touches an edge's inside is also a corner of the faces beside it.
TEST(MeshBuilder, AWallHasNoCornerWithinAnEdge) {
  Mesh mesh;
  add_wall(mesh, {{0, 0, 0}, {6, 0, 0}, {0, 0, 3}}, {{1, 2, 1, 2}, {3, 4.5, 0.8, 2.2}}, 0.2, {}, {});
  for (const auto& t : mesh.triangles) {
    for (std::size_t k = 0; k < 3; ++k) {
      const Eigen::Vector3f a = mesh.vertices[t[k]], b = mesh.vertices[t[(k + 1) % 3]];
      for (const Eigen::Vector3f& v : mesh.vertices) {
        const float along = (v - a).dot(b - a) / (b - a).squaredNorm();
        if (along < 1e-3F || along > 1 - 1e-3F) continue;
        EXPECT_GT((v - a - along * (b - a)).norm(), 1e-3F);
      }
    }
  }
}

TEST(MeshBuilder, APrintLiesOverItsFace) {
  Mesh mesh;
  const Face wall{{0, 0, 0}, {0, 4, 0}, {0, 0, 3}};
  add_print(mesh, wall, {1, 1.5, 1, 1.7}, {});
  EXPECT_NEAR(area(mesh), 0.35, 1e-5);
  for (const Eigen::Vector3f& v : mesh.vertices) EXPECT_NEAR(v.x(), kPrintLift, 1e-7);
}

TEST(MeshBuilder, AMovedMeshKeepsItsShape) {
  Mesh box, moved;
  add_box(box, {}, {1, 2, 3}, {});
  add_box(moved, {}, {0.5, 0.5, 0.5}, {});
  add_mesh(moved, box, kTilted);
  EXPECT_NEAR(volume(moved), 6.125, 1e-4);
  expect_sound(moved, 0.9999);
}

}  // namespace
}  // namespace evpose::sim
