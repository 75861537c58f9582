// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "evpose/io/files/test_files.h"
#include "evpose/io/maps/map_h5.h"
#include "evpose/map/triangulation.h"
#include "evpose/map_build/gravity.h"
#include "evpose/map_build/neighbours.h"
#include "evpose/map_build/normal_table.h"
#include "evpose/map_build/section_fit.h"
#include "evpose/map_build/step_fit.h"
#include "evpose/map_build/test_scan.h"
#include "evpose/map_build/tiles.h"

namespace evpose::map_build {
namespace {

/// Floor and two walls that meet at the origin, turned so that nothing lies along an axis.
PointCloud room_corner(unsigned seed) {
  Scan scan(seed);
  scan.rectangle({0, 0, 0}, {1.5, 0, 0}, {0, 1.2, 0});
  scan.rectangle({0, 0, 0}, {0, 1.2, 0}, {0, 0, 1});
  scan.rectangle({0, 0, 0}, {0, 0, 1}, {1.5, 0, 0});
  return scan.cloud();
}

SurfacePoints described(std::vector<Eigen::Vector3f> points) {
  ThreadPool pool(2);
  const Neighbours tree(points);
  const auto scale = measure_scale(points, tree, {}, "scan");
  return describe_surface(std::move(points), tree, *scale, {}, pool);
}

TEST(SurfacePoints, NoiseAndSpacingOfAPlaneAreWhatTheyWereMadeWith) {
  const auto points = Scan(1).rectangle({0, 0, 0}, {2, 0, 0}, {0, 2, 0}).cloud().points;
  const auto scale = measure_scale(points, Neighbours(points), {}, "scan");
  ASSERT_TRUE(scale);
  EXPECT_NEAR(scale->noise_m, kNoise, 0.1 * kNoise);
  EXPECT_NEAR(scale->spacing_m, 0.02, 0.002);
}

TEST(SurfacePoints, NormalsAreKnownAsWellAsWasAskedFor) {
  const auto points = Scan(2).rectangle({0, 0, 0}, {2, 0, 0}, {0, 2, 0}).cloud().points;
  const PatchConfig config;
  const SurfacePoints surface = described(points);
  double sum = 0;
  int count = 0;
  for (std::size_t i = 0; i < surface.size(); ++i) {
    const auto& p = surface.position[i];
    if (p.x() < 0.2F || p.x() > 1.8F || p.y() < 0.2F || p.y() > 1.8F) continue;
    sum += surface.normal[i].head<2>().cast<double>().squaredNorm();
    ++count;
  }
  // Two tilts.
  const double sigma = std::sqrt(sum / count / 2);
  EXPECT_LT(sigma, 1.3 * config.normal_sigma_rad);
  EXPECT_GT(sigma, 0.5 * config.normal_sigma_rad);
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

TEST(Tiles, EachPointIsHeldByOneAndNoTileIsTooLarge) {
  std::mt19937 random(28);
  std::uniform_real_distribution<float> across(0, 60), along(0, 25);
  std::vector<Eigen::Vector3f> points(20000);
  for (auto& p : points) p = {across(random), along(random), 0};
  const auto tiles = cut_into_tiles(points, 6000, 1);
  EXPECT_EQ(tiles.size(), 4U);
  std::vector<std::size_t> held(tiles.size(), 0);
  for (const auto& p : points) {
    int holders = 0;
    for (std::size_t k = 0; k < tiles.size(); ++k)
      if (tiles[k].holds(p)) ++holders, ++held[k];
    EXPECT_EQ(holders, 1);
  }
  for (const std::size_t count : held) EXPECT_LT(count, 6600U);
}

TEST(Tiles, AClippedPieceLiesInItsCore) {
  constexpr float kFar = std::numeric_limits<float>::infinity();
  Piece piece;
  piece.begin = {0, 0, 0};
  piece.end = {4, 2, 1};
  const auto half = clipped(piece, {{1, -kFar}, {3, kFar}, 0.5F});
  ASSERT_TRUE(half);
  EXPECT_TRUE(half->begin.isApprox(Eigen::Vector3d(1, 0.5, 0.25)));
  EXPECT_TRUE(half->end.isApprox(Eigen::Vector3d(3, 1.5, 0.75)));
  EXPECT_FALSE(clipped(piece, {{5, -kFar}, {kFar, kFar}, 0.5F}));
}

TEST(Tiles, ACreaseAcrossTilesIsWholeAndStraight) {
  Scan scan(29);  // a kerb of 30 m along x
  scan.rectangle({0, 0, 0}, {30, 0, 0}, {0, 0.6, 0}, 1600)
      .rectangle({0, 0, 0}, {30, 0, 0}, {0, 0, 0.5}, 1600);
  BuildConfig config;
  config.tile_points = 20'000;
  ThreadPool pool(2);
  const auto built = build_map(scan.cloud(), config, pool, [](double) { return true; });
  ASSERT_TRUE(built) << built.error().line();
  EXPECT_GT(built->figures.tiles, 1U);
  double length = 0;
  for (std::size_t i = 0; i < built->map.points.size(); ++i) {
    const ContourPoint& p = built->map.points[i];
    if (p.kind != ContourKind::crease || std::abs(p.tangent.x()) < 0.9F) continue;
    EXPECT_LT(built->map.position(i).tail<2>().norm(), 0.005);
    length += static_cast<double>(p.length);
  }
  EXPECT_NEAR(length, 30, 0.3);
}

TEST(Tiles, OrderOfThePointsDoesNotMatterAndDuplicatesGo) {
  PointCloud one = room_corner(30), other = one;
  std::mt19937 random(31);
  other.points.insert(other.points.end(), one.points.begin(), one.points.begin() + 100);
  std::shuffle(other.points.begin(), other.points.end(), random);
  EXPECT_EQ(put_in_order(one), 0U);
  EXPECT_EQ(put_in_order(other), 100U);
  EXPECT_EQ(one.points, other.points);
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

TEST(NormalTable, IsTheNormalDistributionToFiveDigits) {
  for (double x = -9; x < 9; x += 0.0137) {
    EXPECT_NEAR(normal().density(x), std::exp(-0.5 * x * x) / std::sqrt(2 * M_PI), 1e-5);
    EXPECT_NEAR(normal().below(x), 0.5 * std::erfc(-x / std::sqrt(2.0)), 1e-5);
    EXPECT_NEAR(normal().ramp(x + 1e-2) - normal().ramp(x - 1e-2), 2e-2 * normal().below(x), 1e-5);
  }
}

TEST(StepFit, FindsTheEdgeOfADensityWithinItsOwnError) {
  std::mt19937 random(9);
  double squares = 0;
  constexpr int kTrials = 60;
  for (int trial = 0; trial < kTrials; ++trial) {
    std::uniform_real_distribution<double> t(-0.5, 0.5), d(-0.1, 0.013);
    std::normal_distribution<double> blur(0, 0.008);
    std::vector<Eigen::Vector2d> points;
    for (int i = 0; i < 250; ++i) {
      const Eigen::Vector2d p(t(random), d(random) + blur(random));
      if (std::abs(p.y()) < 0.08) points.push_back(p);
    }
    const StepFit step = fit_step(points, 0.5, 0.08, 0.008);
    ASSERT_TRUE(step.converged);
    squares += std::pow((step.place - 0.013) / step.sigma_place, 2);
    EXPECT_LT(step.sigma_place, 0.003);
  }
  EXPECT_NEAR(squares / kTrials, 1, 0.6);
}

TEST(StepFit, TheTrueSoftnessIsTheLikeliest) {
  std::mt19937 random(27);
  std::uniform_real_distribution<double> t(-0.5, 0.5), d(-0.15, 0.01);
  std::normal_distribution<double> blur(0, 0.008);
  std::vector<Eigen::Vector2d> points;
  for (int i = 0; i < 3000; ++i) {
    const Eigen::Vector2d p(t(random), d(random) + blur(random));
    if (std::abs(p.y()) < 0.07) points.push_back(p);
  }
  const StepFit right = fit_step(points, 0.5, 0.07, 0.008);
  ASSERT_TRUE(right.converged);
  EXPECT_NEAR(right.place, 0.01, 0.002);
  for (const double wrong : {0.002, 0.03, 0.045}) {
    const StepFit step = fit_step(points, 0.5, 0.07, wrong);
    EXPECT_LT(step.log_likelihood, right.log_likelihood);
  }
}

/// Points around an edge (along, outwards, over the plane) of a plane that ends at y = 0, of a face of
/// `depth` that hangs from it, and of what is under that; blurred along a ray of unit `ray`.
std::vector<Eigen::Vector3d> section_points(unsigned seed, double depth, bool under,
                                            const Eigen::Vector2d& ray, int on_plane = 700) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0, kNoise);
  std::uniform_real_distribution<double> t(-0.5, 0.5), y(-0.2, 0), z(-depth, 0);
  std::vector<Eigen::Vector3d> out;
  const auto add = [&](double along, double across, double over) {
    const Eigen::Vector2d p = Eigen::Vector2d(across, over) + noise(random) * ray;
    if (std::abs(p.x()) < 0.09 && std::abs(p.y()) < 0.09) out.emplace_back(along, p.x(), p.y());
  };
  for (int i = 0; i < on_plane; ++i) add(t(random), y(random), 0);
  for (int i = 0; i < static_cast<int>(5000 * depth); ++i) add(t(random), 0, z(random));
  for (int i = 0; under && i < 400; ++i) add(t(random), y(random), -depth);
  return out;
}

TEST(SectionFit, AFaceNarrowerThanItIsNoisyDoesNotPushTheEdge) {
  // A board of 25 mm seen at 45 degrees: both its edges, each within what is said of it.
  const SectionWindow window{0.5, 0.09, 0.09, kNoise, 0.7 * kNoise, 0.005};
  double place = 0, depth = 0;
  constexpr int kTrials = 12;
  for (unsigned seed = 0; seed < kTrials; ++seed) {
    const SectionFit fit =
        fit_section(section_points(seed, 0.025, true, Eigen::Vector2d(1, 1).normalized()), window);
    ASSERT_EQ(fit.side, -1) << seed;
    EXPECT_TRUE(fit.ends);
    EXPECT_GT(fit.gain, 20);
    EXPECT_LT(fit.rest_share, 0.1);
    const double stated = std::hypot(fit.sigma_place, 0.1 * kNoise);  // a contour's: it never says less
    place += std::pow(fit.place / stated, 2) / kTrials;
    depth += std::pow((fit.depth - 0.025) / fit.sigma_depth, 2) / kTrials;
    EXPECT_LT(std::abs(fit.place), 0.004);
    EXPECT_LT(std::abs(fit.depth - 0.025), 0.012);
  }
  EXPECT_LT(place, 2);
  EXPECT_LT(depth, 4);
}

TEST(SectionFit, TheOtherWayUpIsTheSameFaceOnTheOtherSide) {
  const SectionWindow window{0.5, 0.09, 0.09, kNoise, kNoise, 0.005};
  auto points = section_points(3, 0.06, false, {0.6, 0.8});
  const SectionFit down = fit_section(points, window);
  for (auto& p : points) p.z() = -p.z();
  const SectionFit up = fit_section(points, window);
  EXPECT_EQ(down.side, -1);
  EXPECT_EQ(up.side, 1);
  EXPECT_NEAR(down.place, up.place, 1e-6);
  EXPECT_NEAR(down.height, -up.height, 1e-6);
  EXPECT_NEAR(down.depth, up.depth, 1e-6);
}

TEST(SectionFit, APlaneThatMerelyEndsHasNoFace) {
  for (unsigned seed = 0; seed < 8; ++seed)
    for (const double angle : {0.0, 0.7, 1.2}) {
      const SectionWindow window{0.5, 0.09, 0.09, kNoise, kNoise * std::cos(angle), 0.005};
      const SectionFit fit =
          fit_section(section_points(seed, 0, false, {std::sin(angle), std::cos(angle)}), window);
      EXPECT_LT(fit.gain, 10) << seed << " " << angle;
      EXPECT_TRUE(fit.side != 0 || std::abs(fit.place) < 0.01);
    }
}

TEST(SectionFit, PointsThatLeanAlongTheirRaysAreNoFace) {
  // A ceiling seen askew over a beam: its last points are lifted and shifted at once.
  for (unsigned seed = 0; seed < 6; ++seed)
    for (const double angle : {-1.0, -0.6, 0.6, 1.0}) {
      const SectionWindow window{0.5, 0.09, 0.09, kNoise, kNoise * std::cos(angle), 0.005};
      const SectionFit fit =
          fit_section(section_points(seed, 0, false, {std::sin(angle), std::cos(angle)}, 4000), window);
      EXPECT_LT(fit.gain, 10) << seed << " " << angle;
      EXPECT_LT(std::abs(fit.place), 0.004) << seed << " " << angle;
    }
}

TEST(Neighbours, WithinIsWhatCountingFinds) {
  std::mt19937 random(28);
  std::uniform_real_distribution<float> share(0, 1);
  std::vector<Eigen::Vector3f> points;
  for (int i = 0; i < 2000; ++i) points.emplace_back(share(random), share(random), share(random));
  const Neighbours tree(points);
  std::vector<std::uint32_t> found;
  const Eigen::Vector3f p(0.4F, 0.5F, 0.6F);
  tree.within(p, 0.2F, found);
  std::sort(found.begin(), found.end());
  std::vector<std::uint32_t> counted;
  for (std::uint32_t i = 0; i < points.size(); ++i)
    if ((points[i] - p).norm() < 0.2F) counted.push_back(i);
  EXPECT_EQ(found, counted);
}

TEST(Outline, HasTheAreaOfThePlateWithoutItsHole) {
  Scan scan(10);  // a frame of four boards around a hole of 0.6 x 0.4
  scan.rectangle({0, 0, 0}, {1.2, 0, 0}, {0, 0.3, 0}, 8000)
      .rectangle({0, 0.7, 0}, {1.2, 0, 0}, {0, 0.3, 0}, 8000);
  scan.rectangle({0, 0.3, 0}, {0.3, 0, 0}, {0, 0.4, 0}, 8000)
      .rectangle({0.9, 0.3, 0}, {0.3, 0, 0}, {0, 0.4, 0}, 8000);
  const auto points = scan.cloud().points;
  const SurfacePoints surface = described(points);
  const Planes planes = find_planes(surface, {});
  ASSERT_EQ(planes.planes.size(), 1U);
  const Outline outline = trace_outline(surface, planes.planes[0]);
  ASSERT_EQ(outline.rings.size(), 2U);
  EXPECT_EQ(outline.rings[1].hole_of, 0);
  EXPECT_GT(twice_area(outline.rings[0].corners), 0);
  EXPECT_NEAR(0.5 * (twice_area(outline.rings[0].corners) + twice_area(outline.rings[1].corners)), 1.2 - 0.24,
              0.08);
  // What hides for certain is smaller by a cell all round.
  ASSERT_EQ(outline.solid.size(), 2U);
  const double solid = 0.5 * (twice_area(outline.solid[0].corners) + twice_area(outline.solid[1].corners));
  EXPECT_NEAR(solid, 1.2 - 0.24 - outline.cell_m * (2 * 2.2 + 2 * 1.0), 0.08);
}

TEST(Outline, WhatPointsAreTooFewToCoverHidesNothing) {
  Scan scan(32);  // a wall; over half of it only slats of 3 cm, 12 cm apart, have points
  scan.rectangle({0, 0, 0}, {1, 0, 0}, {0, 1.2, 0}, 8000);
  for (int k = 0; k < 8; ++k) scan.rectangle({1.09 + 0.12 * k, 0, 0}, {0.03, 0, 0}, {0, 1.2, 0}, 8000);
  const auto points = scan.cloud().points;
  const SurfacePoints surface = described(points);
  const Planes planes = find_planes(surface, {});
  ASSERT_GE(planes.planes.size(), 1U);
  double solid = 0;
  for (const FittedPlane& plane : planes.planes)
    for (const Ring& ring : trace_outline(surface, plane).solid) solid += 0.5 * twice_area(ring.corners);
  EXPECT_GT(solid, 0.9);
  EXPECT_LT(solid, 1.25);
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

TEST(Gravity, ATiltedRoomIsLevelledByItsFloorAndWalls) {
  const Eigen::AngleAxisd tilt(0.047, Eigen::Vector3d(1, 2, 0).normalized());
  PointCloud cloud = room_corner(12);
  for (auto& p : cloud.points) p = (tilt * p.cast<double>()).cast<float>();
  auto built = build(cloud);
  ASSERT_TRUE(built);
  const UpDirection up = find_up(built->map);
  ASSERT_TRUE(up.known);
  EXPECT_LT((up.up - tilt * Eigen::Vector3d::UnitZ()).norm(), 0.002);
  EXPECT_NEAR(up.tilt_rad, 0.047, 0.002);
  level(built->map, up.up);
  EXPECT_LT(find_up(built->map).tilt_rad, 1e-4);
  for (const auto& plane : built->map.planes) {
    const auto upright = static_cast<double>(std::abs(plane.normal.z()));
    EXPECT_LT(std::min(upright, 1 - upright), 0.01);
  }
}

TEST(Gravity, ASlopingCeilingDoesNotTiltTheFloor) {
  ContourMap map;
  const Eigen::Vector3f floor = Eigen::Vector3f(-0.046F, 0.007F, 1).normalized();
  map.planes.push_back({floor, 0, 50'000, 0.01F});
  map.planes.push_back(
      {Eigen::Vector3f(0.007F, 0.005F, 1).normalized(), 0, 15'000, 0.01F});  // 3 degrees off it
  map.planes.push_back({floor.cross(Eigen::Vector3f::UnitX()).normalized(), 0, 5000, 0.01F});
  const UpDirection up = find_up(map);
  ASSERT_TRUE(up.known);
  EXPECT_LT((up.up - floor.cast<double>()).norm(), 0.002);
}

TEST(Gravity, WallsOfOneDirectionLeaveItUnknown) {
  ContourMap map;
  map.planes.push_back({Eigen::Vector3f::UnitX(), 0, 1000, 0.01F});
  EXPECT_FALSE(find_up(map).known);
  map.planes.push_back({Eigen::Vector3f::UnitY(), 0, 1000, 0.01F});
  EXPECT_TRUE(find_up(map).known);
}

TEST(Triangulation, CoversTheRingButNotItsHole) {
  const MapPlane plane{Eigen::Vector3f(0.6F, 0, 0.8F), 0, 0, 0};
  const auto at = [](float x, float y) { return Eigen::Vector3f(0.8F * x, y, -0.6F * x); };
  MapPolygon outer{{at(0, 0), at(4, 0), at(4, 3), at(2, 1), at(0, 3)}, 0, -1};
  MapPolygon hole{{at(0.5F, 0.5F), at(0.5F, 1), at(1, 1), at(1, 0.5F)}, 0, 0};
  const TriangleMesh mesh = triangulated({plane}, {outer, hole});
  double area = 0;
  for (const auto& t : mesh.triangles)
    area += 0.5 * static_cast<double>((mesh.vertices[t[1]] - mesh.vertices[t[0]])
                                          .cross(mesh.vertices[t[2]] - mesh.vertices[t[0]])
                                          .norm());
  EXPECT_NEAR(area, 12 - 4 - 0.25, 1e-4);
}

}  // namespace
}  // namespace evpose::map_build
