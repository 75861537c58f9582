// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <utility>

#include "evpose/io/files/test_files.h"
#include "evpose/io/maps/map_h5.h"
#include "evpose/map_build/test_scan.h"

namespace evpose::map_build {
namespace {

/// Rms distance across the contour of what was built along a line, and its length.
std::pair<double, double> across_line(const ContourMap& map, const Eigen::Vector3d& on,
                                      const Eigen::Vector3d& along, double reach_m) {
  double squares = 0, length = 0;
  for (std::size_t i = 0; i < map.points.size(); ++i) {
    const auto& p = map.points[i];
    const Eigen::Vector3d d = map.position(i) - on, across = d - along * along.dot(d);
    if (std::abs(p.tangent.cast<double>().dot(along)) < 0.95 || across.norm() > reach_m) continue;
    squares += across.squaredNorm() * static_cast<double>(p.length);
    length += static_cast<double>(p.length);
  }
  return {length > 0 ? std::sqrt(squares / length) : INFINITY, length};
}

TEST(MapBuilder, CreasesOfACornerMeetInItToTwoMillimetres) {
  const auto built = build(room_corner(3));
  ASSERT_TRUE(built) << built.error().line();
  EXPECT_EQ(built->figures.planes, 3U);
  Eigen::Vector3d covered = Eigen::Vector3d::Zero();
  double squares = 0;
  for (std::size_t i = 0; i < built->map.points.size(); ++i) {
    const ContourPoint& p = built->map.points[i];
    if (p.kind != ContourKind::crease) continue;
    const Eigen::Vector3d x = built->map.position(i);
    Eigen::Index axis = 0;
    p.tangent.cwiseAbs().maxCoeff(&axis);
    Eigen::Vector3d across = x;
    across[axis] = 0;
    EXPECT_LT(across.norm(), 0.004);
    squares += across.squaredNorm() * static_cast<double>(p.length);
    covered[axis] += static_cast<double>(p.length);
    // Out of both surfaces: towards the negative octant.
    EXPECT_LT(p.normal.dot(Eigen::Vector3f::Ones()), -0.9F);
    EXPECT_LT(p.normal_b.dot(Eigen::Vector3f::Ones()), -0.9F);
  }
  EXPECT_LT(std::sqrt(squares / covered.sum()), 0.002);
  EXPECT_NEAR(covered.x(), 1.5, 0.06);
  EXPECT_NEAR(covered.y(), 1.2, 0.06);
  EXPECT_NEAR(covered.z(), 1.0, 0.06);
}

TEST(MapBuilder, APlateEndsWhereItEndsWhateverItsDensity) {
  for (const double per_m2 : {1200.0, 5000.0}) {
    double inset = 0, length = 0;
    for (unsigned seed = 0; seed < 3; ++seed) {
      const auto built =
          build(Scan(seed).rectangle({-0.6, -0.4, 0}, {1.2, 0, 0}, {0, 0.8, 0}, per_m2).cloud());
      ASSERT_TRUE(built) << built.error().line();
      for (std::size_t i = 0; i < built->map.points.size(); ++i) {
        const ContourPoint& p = built->map.points[i];
        const Eigen::Vector3d x = built->map.position(i);
        EXPECT_EQ(p.kind, ContourKind::boundary);
        const bool side = std::abs(p.tangent.y()) > 0.5F;
        const double outwards = side ? std::abs(x.x()) - 0.6 : std::abs(x.y()) - 0.4;
        EXPECT_LT(std::abs(outwards), 0.02);
        inset += outwards * static_cast<double>(p.length);
        length += static_cast<double>(p.length);
      }
    }
    EXPECT_GT(length, 3 * 2.0);
    EXPECT_LT(std::abs(inset / length), 0.15 / std::sqrt(per_m2));
  }
}

TEST(MapBuilder, AnEdgeBesideASkirtingIsTheSkirtings) {
  Scan scan(20);  // a wall with a skirting of 16 mm, 12 cm high
  scan.rectangle({0, 0, 0}, {2, 0, 0}, {0, 1.5, 0});
  scan.rectangle({0, 0, 0.12}, {2, 0, 0}, {0, 0, 1.5}).rectangle({0, 0.016, 0}, {2, 0, 0}, {0, 0, 0.12});
  const auto built = build(scan.cloud());
  ASSERT_TRUE(built) << built.error().line();
  const auto [rms, length] = across_line(built->map, {0, 0.016, 0}, Eigen::Vector3d::UnitX(), 0.03);
  EXPECT_GT(length, 1.5);
  EXPECT_LT(rms, 0.004);
}

TEST(MapBuilder, AWallEndsAtTheFootOfItsPlinth) {
  // 40 mm before the wall, under a noise of 15 mm.
  const auto built = build(Scan(22)
                               .rectangle({0, 0.04, 0}, {4, 0, 0}, {0, 0, 0.8})
                               .rectangle({0, 0, 0.8}, {4, 0, 0}, {0, 0, 1.7})
                               .rectangle({0, 0.04, 0}, {4, 0, 0}, {0, 1.5, 0})
                               .cloud());
  ASSERT_TRUE(built) << built.error().line();
  const auto [rms, length] = across_line(built->map, {0, 0.04, 0}, Eigen::Vector3d::UnitX(), 0.03);
  EXPECT_GT(length, 3.5);
  EXPECT_LT(rms, 0.002);
}

TEST(MapBuilder, APillarDoesNotLean) {
  double worst = 0;
  for (unsigned seed = 21; seed < 24; ++seed) {
    Scan scan(seed);
    scan.rectangle({0, 0, 0}, {0.3, 0, 0}, {0, 0, 2}).rectangle({0, 0, 0}, {0, 0.3, 0}, {0, 0, 2});
    scan.rectangle({-1, -1, 0}, {3, 0, 0}, {0, 3, 0}, 1000);
    const auto built = build(scan.cloud());
    ASSERT_TRUE(built) << built.error().line();
    const auto [rms, length] = across_line(built->map, {0, 0, 0}, Eigen::Vector3d::UnitZ(), 0.03);
    EXPECT_GT(length, 1.5);
    worst = std::max(worst, rms);
  }
  EXPECT_LT(worst, 0.003);
}

TEST(MapBuilder, NoiseAlongAskewRaysDoesNotMoveAnEdge) {
  // A plate seen from the side at 45 degrees: noise lifts points and shifts them outwards at once.
  PointCloud cloud;
  std::mt19937 random(25);
  std::uniform_real_distribution<double> share(0, 1);
  std::normal_distribution<double> noise(0, kNoise);
  for (int i = 0; i < 6000; ++i) {
    const double e = noise(random);
    cloud.points.emplace_back(
        Eigen::Vector3d(1.2 * share(random) - 0.6 + e, 2 * share(random) - 1, e).cast<float>());
  }
  const auto built = build(cloud);
  ASSERT_TRUE(built) << built.error().line();
  for (const double side : {-0.6, 0.6}) {
    const auto [rms, length] = across_line(built->map, {side, 0, 0}, Eigen::Vector3d::UnitY(), 0.03);
    EXPECT_GT(length, 1.2);
    EXPECT_LT(rms, 0.4 * kNoise);
  }
}

TEST(MapBuilder, AFaceTooNarrowForAPlaneStillMakesACrease) {
  Scan scan(26);  // a table top with a board of 6 cm under its front
  scan.rectangle({0, 0, 0}, {1.4, 0, 0}, {0, 0.8, 0}).rectangle({0, 0, -0.06}, {1.4, 0, 0}, {0, 0, 0.06});
  const auto built = build(scan.cloud());
  ASSERT_TRUE(built) << built.error().line();
  const auto [rms, length] = across_line(built->map, {0, 0, 0}, Eigen::Vector3d::UnitX(), 0.03);
  EXPECT_GT(length, 0.9);
  EXPECT_LT(rms, 0.005);
  for (const auto& p : built->map.points)
    EXPECT_TRUE(p.kind != ContourKind::crease || p.normal_b.norm() > 0.9F);
}

/// A front above a floor that goes on under it, from a height on.
Expected<BuiltMap> front_above_floor(unsigned seed, double from_m, double height_m) {
  Scan scan(seed);
  scan.rectangle({-1, -0.6, 0}, {3.4, 0, 0}, {0, 1.5, 0}, 1000);
  scan.rectangle({0, 0, from_m}, {1.4, 0, 0}, {0, 0, height_m}, 2500);
  return build(scan.cloud());
}

TEST(MapBuilder, AFrontThatEndsAboveTheFloorHasNoEdgeWithIt) {
  for (unsigned seed = 40; seed < 44; ++seed) {
    for (const double from_m : {0.0, 0.08}) {
      const auto built = front_above_floor(seed, from_m, 0.7);
      ASSERT_TRUE(built) << built.error().line();
      double length = 0;
      for (std::size_t i = 0; i < built->map.points.size(); ++i) {
        const ContourPoint& p = built->map.points[i];
        const Eigen::Vector3d x = built->map.position(i);
        if (p.kind == ContourKind::crease && std::hypot(x.y(), x.z()) < 0.02)
          length += static_cast<double>(p.length);
      }
      if (from_m > 0)
        EXPECT_LT(length, 0.2) << seed;  // of 1.4
      else
        EXPECT_GT(length, 1.2) << seed;
    }
  }
}

TEST(MapBuilder, TheNarrowerAFaceTheLessItsEdgeIsKnown) {
  const auto sigma_m = [](double height_m) {
    const auto built = front_above_floor(44, 0, height_m);
    double sum = 0, count = 0;
    for (std::size_t i = 0; i < built->map.points.size(); ++i) {
      const Eigen::Vector3d x = built->map.position(i);
      if (built->map.points[i].kind != ContourKind::crease || std::hypot(x.y(), x.z()) > 0.02) continue;
      sum += static_cast<double>(built->map.points[i].sigma), ++count;
    }
    return sum / count;
  };
  const double wide = sigma_m(2), narrow = sigma_m(0.3);
  const double mixed = 6 * kNoise * kNoise / std::sqrt(2.0);
  EXPECT_NEAR(std::sqrt(narrow * narrow - wide * wide), mixed * std::sqrt(1 / (0.3 * 0.3) - 1 / (2 * 2.0)),
              0.0008);
}

TEST(MapBuilder, TheSameBytesForAnyNumberOfThreads) {
  const auto one = build(room_corner(4), 1), three = build(room_corner(4), 3);
  ASSERT_TRUE(one && three);
  ASSERT_EQ(one->map.points.size(), three->map.points.size());
  for (std::size_t i = 0; i < one->map.points.size(); ++i)
    EXPECT_EQ(one->map.points[i].position, three->map.points[i].position);
}

TEST(MapBuilder, WhereTheWallGoesOnAboveACupboardTheirEdgeIsOpen) {
  for (const double height : {1.0, 1.6}) {
    Scan scan(27);  // the side of a cupboard on a wall of 1.6 m
    scan.rectangle({-0.8, 0, 0}, {1.6, 0, 0}, {0, 0, 1.6}).rectangle({0, 0, 0}, {0, 0.5, 0}, {0, 0, height});
    const auto built = build(scan.cloud());
    ASSERT_TRUE(built) << built.error().line();
    double on_the_wall = 0;
    for (std::size_t i = 0; i < built->map.points.size(); ++i) {
      const ContourPoint& p = built->map.points[i];
      const Eigen::Vector3d x = built->map.position(i);
      if (p.kind == ContourKind::crease && std::abs(p.tangent.z()) > 0.9F && x.head<2>().norm() < 0.008)
        on_the_wall += static_cast<double>(p.length);
    }
    if (height == 1.6)
      EXPECT_GT(on_the_wall, 1.4);
    else
      EXPECT_LT(on_the_wall, 0.1);
  }
}

TEST(MapBuilder, TheFirstContrastIsThatOfTheIntensities) {
  for (const bool dark_floor : {false, true}) {
    PointCloud cloud = room_corner(33);
    // The floor's points come first, and are as many as its share of the area.
    const auto floor = static_cast<std::size_t>(2500 * 1.5 * 1.2);
    std::mt19937 random(34);
    std::uniform_int_distribution<int> scatter(-20, 20);
    for (std::size_t i = 0; i < cloud.points.size(); ++i)
      cloud.brightness.push_back(
          static_cast<std::uint8_t>(((i < floor) == dark_floor ? 60 : 160) + scatter(random)));
    const auto built = build(cloud);
    ASSERT_TRUE(built) << built.error().line();
    for (const ContourPoint& p : built->map.points) {
      if (p.kind != ContourKind::crease) continue;
      if (std::abs(p.tangent.z()) > 0.9F) {  // between the walls, which are equally bright
        EXPECT_EQ(p.contrast, 0);
        continue;
      }
      const bool from_floor = std::abs(p.normal.z()) < 0.5F;
      EXPECT_EQ(p.contrast, from_floor == dark_floor ? 1 : -1);
    }
  }
}

TEST(MapBuilder, WhatIsNoSurfaceIsNamed) {
  Scan line(5), sparse(6);
  PointCloud on_a_line;
  for (int i = 0; i < 1000; ++i) on_a_line.points.emplace_back(0.001F * static_cast<float>(i), 0.0F, 0.0F);
  const auto a = build(on_a_line);
  ASSERT_FALSE(a);
  EXPECT_NE(a.error().what.find("lines"), std::string::npos);
  PointCloud fog;
  std::mt19937 random(7);
  std::uniform_real_distribution<float> share(0, 1);
  for (int i = 0; i < 3000; ++i) fog.points.emplace_back(share(random), share(random), share(random));
  EXPECT_FALSE(build(fog));
  PointCloud same;
  same.points.assign(1000, Eigen::Vector3f(1, 2, 3));
  EXPECT_FALSE(build(same));
  EXPECT_FALSE(build(PointCloud()));
}

TEST(MapFile, KeepsPlanesAndPolygonsAndTheyHide) {
  auto built = build(room_corner(11));
  ASSERT_TRUE(built);
  const TemporaryFolder folder;
  const std::string path = folder / "map.h5";
  ASSERT_TRUE(write_map_h5(path, built->map));
  const auto read = read_map_h5(path);
  ASSERT_TRUE(read) << read.error().line();
  ASSERT_EQ(read->planes.size(), built->map.planes.size());
  EXPECT_EQ(read->planes[1].d, built->map.planes[1].d);
  ASSERT_EQ(read->polygons.size(), built->map.polygons.size());
  EXPECT_EQ(read->polygons[0].vertices, built->map.polygons[0].vertices);
  EXPECT_EQ(read->occluders.triangles, built->map.occluders.triangles);
  EXPECT_FALSE(read->occluders.triangles.empty());
  EXPECT_EQ(read->points[0].normal_b, built->map.points[0].normal_b);
}

}  // namespace
}  // namespace evpose::map_build
