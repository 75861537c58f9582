// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_build/paper_map.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include "evpose/map_build/grown_regions.h"
#include "evpose/map_build/test_scan.h"

namespace evpose::map_build {
namespace {

constexpr double kPerM2 = 4000;

/// The surface of the cube from -0.5 to 0.5 m, each point noisy across its face.
PointCloud cube(double noise_m, unsigned seed) {
  PointCloud cloud;
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> share(-0.5, 0.5);
  std::normal_distribution<double> noise(0, 1);
  for (int face = 0; face < 6; ++face)
    for (int i = 0; i < static_cast<int>(kPerM2); ++i) {
      Eigen::Vector3d x(share(random), share(random), share(random));
      x[face / 2] = (face % 2 == 0 ? -0.5 : 0.5) + noise_m * noise(random);
      cloud.points.push_back(x.cast<float>());
    }
  return cloud;
}

struct CubeEdges {
  std::array<double, 12> length{};  ///< of contours along each edge, from both faces
  double rms_m = 0;                 ///< distance of the contours' points from the nearest edge
  double furthest_m = 0;
};

/// Of the edges of the cube what the map has along them.
CubeEdges held_to_the_cube(const ContourMap& map) {
  CubeEdges out;
  double squares = 0, all = 0;
  for (std::size_t i = 0; i < map.points.size(); ++i) {
    const Eigen::Vector3d x = map.position(i);
    double nearest = INFINITY;
    std::size_t edge = 0;
    for (int axis = 0; axis < 3; ++axis)
      for (int corner = 0; corner < 4; ++corner) {
        Eigen::Vector3d off = x.cwiseAbs() - Eigen::Vector3d::Constant(0.5);
        off[axis] = 0;
        const bool first = x[(axis + 1) % 3] > 0, second = x[(axis + 2) % 3] > 0;
        if (corner != 2 * first + second || off.norm() >= nearest) continue;
        nearest = off.norm();
        edge = static_cast<std::size_t>(4 * axis + corner);
      }
    const auto length = static_cast<double>(map.points[i].length);
    out.length[edge] += length;
    out.furthest_m = std::max(out.furthest_m, nearest);
    squares += nearest * nearest * length;
    all += length;
  }
  out.rms_m = std::sqrt(squares / all);
  return out;
}

Expected<BuiltMap> paper(PointCloud cloud, int threads = 1) {
  ThreadPool pool(threads);
  return build_paper_map(std::move(cloud), pool, [](double) { return true; });
}

TEST(PaperMap, ACubeHasItsTwelveEdgesFromBothFaces) {
  const auto built = paper(cube(0, 1));
  ASSERT_TRUE(built) << built.error().line();
  EXPECT_EQ(built->figures.planes, 6U);
  const CubeEdges edges = held_to_the_cube(built->map);
  for (const double length : edges.length) {
    EXPECT_GT(length, 1.7);
    EXPECT_LT(length, 2.3);
  }
  // Mostly within a cell of two point spacings; where three faces meet, normals turn as far as a patch
  // reaches.
  EXPECT_LT(edges.rms_m, 2 / std::sqrt(kPerM2));
  EXPECT_LT(edges.furthest_m, std::sqrt(60 / std::numbers::pi / kPerM2));
}

TEST(PaperMap, NoiseOfFiveMillimetresStaysBounded) {
  for (const unsigned seed : {1U, 2U, 3U}) {
    const auto built = paper(cube(0.005, seed));
    ASSERT_TRUE(built) << built.error().line();
    EXPECT_EQ(built->figures.planes, 6U);
    const CubeEdges edges = held_to_the_cube(built->map);
    for (const double length : edges.length) EXPECT_GT(length, 1.5);
    EXPECT_LT(edges.rms_m, 0.03);
    const double stated_m = static_cast<double>(built->map.points.front().sigma);
    EXPECT_LT(edges.rms_m, 3 * stated_m);
    EXPECT_GT(edges.rms_m, 0.3 * stated_m);
  }
}

TEST(PaperMap, ContoursAreClosedAndPointOutOfTheirSurface) {
  // A plate with a window: one line around it, one around the hole.
  std::mt19937 random(4);
  std::uniform_real_distribution<float> share(-1, 1);
  PointCloud cloud;
  for (int i = 0; i < 12000; ++i) {
    const Eigen::Vector3f x(share(random), share(random), 0);
    if (x.head<2>().cwiseAbs().maxCoeff() > 0.4F) cloud.points.push_back(x);
  }
  const auto built = paper(cloud);
  ASSERT_TRUE(built) << built.error().line();
  ASSERT_EQ(built->figures.planes, 1U);
  std::array<double, 2> length{};
  double outwards = 0;
  for (const ContourPoint& p : built->map.points) {
    ASSERT_GE(p.contour, 0);
    ASSERT_LT(p.contour, 2);
    const auto number = static_cast<std::size_t>(p.contour);
    length[number] += static_cast<double>(p.length);
    // Outwards: away from the middle at the rim, towards it at the hole.
    const bool rim = p.position.head<2>().cwiseAbs().maxCoeff() > 0.7F;
    outwards += static_cast<double>((rim ? 1 : -1) * p.length * p.normal.dot(p.position.normalized()));
  }
  EXPECT_GT(outwards, 0.8 * (length[0] + length[1]));
  EXPECT_NEAR(std::max(length[0], length[1]), 8, 0.6);
  EXPECT_NEAR(std::min(length[0], length[1]), 3.2, 0.5);
  ASSERT_FALSE(built->map.occluders.triangles.empty());
}

TEST(GrownRegions, CurvatureIsNoneInAPlaneAndHighestInABend) {
  std::vector<Eigen::Vector3f> points;
  for (int i = 0; i < 60; ++i)
    for (int k = 0; k < 60; ++k) {
      const float a = 0.02F * static_cast<float>(i), b = 0.02F * static_cast<float>(k);
      points.emplace_back(a, b, 0.0F);
      if (i > 0) points.emplace_back(0.0F, b, a);
    }
  ThreadPool pool(1);
  const Neighbours tree(points);
  const SurfacePoints surface = describe_by_neighbours(std::move(points), tree, {0.02, 1e-5, 12}, pool);
  double flattest_bend = 1;
  for (std::size_t i = 0; i < surface.size(); ++i) {
    const Eigen::Vector3f& x = surface.position[i];
    const float from_bend = std::max(x.x(), x.z());
    if (from_bend > 0.2F) {
      EXPECT_NEAR(surface.curvature[i], 0, 1e-5);
      EXPECT_NEAR(std::abs(surface.normal[i][x.x() > x.z() ? 2 : 0]), 1, 1e-4);
    }
    if (from_bend == 0.0F && std::abs(x.y() - 0.6F) < 0.3F)
      flattest_bend = std::min(flattest_bend, static_cast<double>(surface.curvature[i]));
  }
  EXPECT_GT(flattest_bend, 0.06);
}

TEST(PaperMap, TheSameBytesForAnyNumberOfThreads) {
  const auto one = paper(cube(0.005, 5), 1), three = paper(cube(0.005, 5), 3);
  ASSERT_TRUE(one && three);
  ASSERT_EQ(one->map.points.size(), three->map.points.size());
  for (std::size_t i = 0; i < one->map.points.size(); ++i)
    EXPECT_EQ(one->map.points[i].position, three->map.points[i].position);
}

TEST(PaperMap, WhatIsNoSurfaceIsNamed) {
  EXPECT_FALSE(paper(PointCloud()));
  PointCloud same;
  same.points.assign(1000, Eigen::Vector3f(1, 2, 3));
  EXPECT_FALSE(paper(same));
  ThreadPool pool(1);
  EXPECT_FALSE(build_paper_map(cube(0, 6), pool, [](double) { return false; }));
}

}  // namespace
}  // namespace evpose::map_build
