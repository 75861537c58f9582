// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/world/printed_things.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

namespace evpose::sim {
namespace {

const Finish kGround{0, 0, {0, 0}, false}, kInk{1, 0, {0, 0}, false};

double area(const Mesh& mesh, std::size_t i) {
  const auto& t = mesh.triangles[i];
  const Eigen::Vector3f ab = mesh.vertices[t[1]] - mesh.vertices[t[0]],
                        ac = mesh.vertices[t[2]] - mesh.vertices[t[0]];
  return 0.5 * static_cast<double>(ab.cross(ac).norm());
}

// Areas by material of the faces whose outside looks along `normal`.
std::map<std::int32_t, double> areas(const Mesh& mesh, const Eigen::Vector3d& normal) {
  std::map<std::int32_t, double> sums;
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i)
    if (triangle_normal(mesh, i).dot(normal) > 0.999) sums[mesh.material[i]] += area(mesh, i);
  return sums;
}

TEST(LandingPad, MarksHaveTheAreasOfTheirProportions) {
  const double size = 3;
  const std::map<PadMark, double> inked = {{PadMark::none, 0},
                                           {PadMark::h, 2 * 0.1 * 0.6 + 0.2 * 0.1},
                                           {PadMark::squares, 0.64 - 0.36 + 0.16 - 0.04}};
  for (const auto& [mark, share] : inked) {
    Mesh mesh;
    add_landing_pad(mesh, {}, {size, 0.3, mark}, kGround, kInk);
    auto top = areas(mesh, Eigen::Vector3d::UnitZ());
    EXPECT_NEAR(top[1], share * size * size, 1e-5);
    EXPECT_NEAR(top[0] + top[1], size * size, 1e-5);
    for (const auto& v : mesh.vertices)
      EXPECT_TRUE(std::abs(v.z()) < 1e-6F || std::abs(v.z() - 0.3F) < 1e-6F);
    EXPECT_NEAR(areas(mesh, Eigen::Vector3d::UnitX())[0], size * 0.3, 1e-5);
  }
}

TEST(LandingPad, ARingLiesOnTheTop) {
  Mesh mesh;
  add_landing_pad(mesh, {so3::exp({0, 0, 0.4}), {5, 6, 7}}, {2, 0, PadMark::ring}, kGround, kInk);
  auto top = areas(mesh, Eigen::Vector3d::UnitZ());
  // A polygon of 96 corners.
  const double polygon = 48 * std::sin(std::numbers::pi / 48);
  EXPECT_NEAR(top[1], polygon * (0.64 - 0.4096), 1e-4);
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    if (mesh.material[i] != 1) continue;
    for (const auto v : mesh.triangles[i]) {
      const Eigen::Vector3d p = mesh.vertices[v].cast<double>() - Eigen::Vector3d(5, 6, 7);
      EXPECT_NEAR(p.z(), 2 * kPrintLift, 1e-5);
      const double radius = p.head<2>().norm();
      EXPECT_TRUE(std::abs(radius - 0.64) < 1e-5 || std::abs(radius - 0.8) < 1e-5);
    }
  }
}

TEST(Checkerboard, SquaresLieWhereTheFrameSaysAndAlternate) {
  Mesh mesh;
  const Checkerboard board{7, 5, 0.08, 0.05, 1.1};
  add_checkerboard(mesh, {}, board, kGround, kInk);
  auto front = areas(mesh, -Eigen::Vector3d::UnitY());
  EXPECT_NEAR(front[0] + front[1], (7 * 0.08 + 0.1) * (5 * 0.08 + 0.1), 1e-5);
  EXPECT_NEAR(front[1], 18 * 0.08 * 0.08, 1e-5);  // of 35, the corner is dark
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    if (triangle_normal(mesh, i).y() > -0.999) continue;
    Eigen::Vector3d middle = Eigen::Vector3d::Zero();
    for (const auto v : mesh.triangles[i]) middle += mesh.vertices[v].cast<double>() / 3;
    EXPECT_NEAR(middle.y(), 0, 1e-6);
    const int column = static_cast<int>(std::floor((middle.x() + 3.5 * 0.08) / 0.08)),
              row = static_cast<int>(std::floor((middle.z() - 1.1 + 2.5 * 0.08) / 0.08));
    const bool square = column >= 0 && column < 7 && row >= 0 && row < 5;
    EXPECT_EQ(mesh.material[i], square && (column + row) % 2 == 0 ? 1 : 0);
  }
  float lowest = 1;
  for (const auto& v : mesh.vertices) lowest = std::min(lowest, v.z());
  EXPECT_NEAR(lowest, 0, 1e-6);
}

}  // namespace
}  // namespace evpose::sim
