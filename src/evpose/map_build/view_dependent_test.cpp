// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>

#include "evpose/map_build/arcs.h"
#include "evpose/map_build/test_scan.h"
#include "evpose/map_build/view_points.h"

namespace evpose::map_build {
namespace {

struct OfKind {
  std::vector<Eigen::Vector3d> at;
  std::vector<ContourPoint> points;
  double length_m = 0;
};

OfKind of_kind(const ContourMap& map, ContourKind kind) {
  OfKind out;
  for (std::size_t i = 0; i < map.points.size(); ++i) {
    if (map.points[i].kind != kind) continue;
    out.at.push_back(map.position(i));
    out.points.push_back(map.points[i]);
    out.length_m += static_cast<double>(map.points[i].length);
  }
  return out;
}

/// Length of the aligned contours that run upright.
double upright_edges_m(const ContourMap& map) {
  double out = 0;
  for (const ContourPoint& p : map.points)
    if (!is_view_dependent(p.kind) && std::abs(p.tangent.z()) > 0.9F) out += static_cast<double>(p.length);
  return out;
}

Scan with_floor(unsigned seed) {
  Scan scan(seed);
  scan.rectangle({-1.2, -1, 0}, {2.4, 0, 0}, {0, 2, 0});
  return scan;
}

TEST(Cylinders, AColumnIsRecordedByItsAxisAndRadiusAndHasNoEdges) {
  for (const double turn : {6.283, 3.142}) {  // seen all round, and from one side
    const auto built = build(with_floor(8).cylinder({0.1, 0.2, 0}, 0.2, 2, 2500, turn).cloud());
    ASSERT_TRUE(built) << built.error().line();
    EXPECT_EQ(built->figures.cylinders, 1U);
    const OfKind axes = of_kind(built->map, ContourKind::cylinder_axis);
    EXPECT_NEAR(axes.length_m, 1.9, 0.15);
    for (std::size_t i = 0; i < axes.at.size(); ++i) {
      EXPECT_LT((axes.at[i].head<2>() - Eigen::Vector2d(0.1, 0.2)).norm(), 0.006);
      EXPECT_NEAR(axes.points[i].sigma, 0.2, 0.006);
      EXPECT_GT(std::abs(axes.points[i].tangent.z()), 0.9999F);
      EXPECT_EQ(axes.points[i].contour, axes.points[0].contour);
    }
    EXPECT_LT(upright_edges_m(built->map), 0.3);
  }
}

TEST(Cylinders, APoleIsFoundThoughItIsThinnerThanItsNoise) {
  for (const double radius : {0.008, 0.03}) {
    const auto built = build(with_floor(41).cylinder({-0.3, 0.1, 0}, radius, 1.5, 6000).cloud());
    ASSERT_TRUE(built) << built.error().line();
    EXPECT_EQ(built->figures.poles + built->figures.cylinders, 1U);
    const OfKind axes = of_kind(built->map, ContourKind::cylinder_axis);
    EXPECT_NEAR(axes.length_m, 1.4, 0.15);
    for (std::size_t i = 0; i < axes.at.size(); ++i) {
      EXPECT_LT((axes.at[i].head<2>() - Eigen::Vector2d(-0.3, 0.1)).norm(), 0.006);
      EXPECT_LT(axes.points[i].sigma, radius + kNoise);
    }
  }
}

TEST(Cylinders, FlatThingsAreNone) {
  Scan scan = with_floor(42);  // a square pillar, a wall, a board on edge
  scan.rectangle({0, 0, 0}, {0.3, 0, 0}, {0, 0, 1.5}).rectangle({0, 0, 0}, {0, 0.3, 0}, {0, 0, 1.5});
  scan.rectangle({0.3, 0, 0}, {0, 0.3, 0}, {0, 0, 1.5}).rectangle({0, 0.3, 0}, {0.3, 0, 0}, {0, 0, 1.5});
  scan.rectangle({-1.2, 1, 0}, {2.4, 0, 0}, {0, 0, 1.5}).rectangle({-1, -0.5, 0}, {0, 0, 1}, {0.2, 0, 0});
  const auto built = build(scan.cloud());
  ASSERT_TRUE(built) << built.error().line();
  EXPECT_EQ(of_kind(built->map, ContourKind::cylinder_axis).length_m, 0);
}

/// Floor and wall of 3 m, seen from 2 m before the wall at a height of 1.2 m past a box before it.
PointCloud scene_with_shadow(unsigned seed, const Eigen::Vector3d& eye) {
  Scan scan(seed);
  scan.rectangle({-1.5, 0, 0}, {3, 0, 0}, {0, 0, 2});
  PointCloud cloud = scan.cloud();
  // The front of the box, which hides part of the wall.
  const Eigen::Vector3d low(-0.3, -0.8, 0.4), high(0.3, -0.8, 1.2);
  std::erase_if(cloud.points, [&](const Eigen::Vector3f& p) {
    const Eigen::Vector3d ray = p.cast<double>() - eye;
    const Eigen::Vector3d x = eye + ray * (low.y() - eye.y()) / ray.y();
    return x.x() > low.x() && x.x() < high.x() && x.z() > low.z() && x.z() < high.z();
  });
  const PointCloud box = Scan(seed + 1).rectangle(low, {0.6, 0, 0}, {0, 0, 0.8}, 6000).cloud();
  cloud.points.insert(cloud.points.end(), box.points.begin(), box.points.end());
  return cloud;
}

TEST(Shadows, WhatSomethingNearerHidesEndsInAShadow) {
  const Eigen::Vector3d eye(0.2, -2, 1);
  PointCloud cloud = scene_with_shadow(43, eye);
  cloud.viewpoints = {eye};
  const auto built = build(cloud);
  ASSERT_TRUE(built) << built.error().line();
  // The rim of the hole in the wall is a shadow, the box's and the wall's own rims are edges.
  const OfKind shadows = of_kind(built->map, ContourKind::shadow);
  const OfKind edges = of_kind(built->map, ContourKind::boundary);
  const double scale = 2 / 1.2, rim = 2 * scale * (0.6 + 0.8);
  EXPECT_NEAR(shadows.length_m, rim, 0.3 * rim);
  for (const auto& x : shadows.at) {
    EXPECT_NEAR(x.y(), 0, 0.05);
    EXPECT_LT(std::abs(x.x() - eye.x()), 1.3);
    EXPECT_GT(x.z(), -0.1);
  }
  double on_the_box = 0, on_the_wall = 0;
  for (std::size_t i = 0; i < edges.at.size(); ++i) {
    const double length = edges.points[i].length;
    on_the_box += edges.at[i].y() < -0.7 ? length : 0;
    if (edges.at[i].y() < -0.7) continue;
    const double from_rim = std::min({1.5 - std::abs(edges.at[i].x()), 2 - edges.at[i].z(), edges.at[i].z()});
    EXPECT_LT(from_rim, 0.05) << edges.at[i].transpose();
    on_the_wall += length;
  }
  EXPECT_GT(on_the_box, 0.8 * 2.8);
  EXPECT_GT(on_the_wall, 0.5 * 10);
}

TEST(Shadows, ASecondViewPastTheObstacleTellsAnEdge) {
  const Eigen::Vector3d eye(0.2, -2, 1), beside(2.5, -1.2, 1);
  std::vector<Eigen::Vector3f> obstacle;
  for (double x = -0.3; x < 0.3; x += 0.01)
    for (double z = 0.7; z < 1.3; z += 0.01) obstacle.push_back(Eigen::Vector3d(x, -0.8, z).cast<float>());
  FittedPlane wall;
  wall.normal = Eigen::Vector3d::UnitY();
  const std::vector<View> one{{eye, obstacle}}, both{{eye, obstacle}, {beside, obstacle}};
  const Eigen::Vector3d behind(-0.1, 0, 1), free(1.4, 0, 1);
  EXPECT_TRUE(hidden_from_all(one, behind, wall, 0.1));
  EXPECT_FALSE(hidden_from_all(one, free, wall, 0.1));
  EXPECT_FALSE(hidden_from_all(both, behind, wall, 0.1));
  EXPECT_FALSE(hidden_from_all({}, behind, wall, 0.1));
  // What lies in the plane hides nothing of it.
  FittedPlane through = wall;
  through.d = 0.8;
  EXPECT_FALSE(hidden_from_all(one, behind, through, 0.1));
}

TEST(Arcs, ACircleThroughPlacesIsFoundDespiteOutliers) {
  std::vector<CurvePlace> places;
  std::mt19937 random(44);
  std::normal_distribution<double> noise(0, 0.002);
  for (int k = 0; k < 20; ++k) {
    const double angle = 0.1 * k, r = 0.4 + noise(random) + (k == 7 ? 0.05 : 0);
    places.push_back({{1 + r * std::cos(angle), 2 + r * std::sin(angle)}, 0.002});
  }
  const auto circle = fit_circle(places);
  ASSERT_TRUE(circle);
  EXPECT_NEAR(circle->radius_m, 0.4, 0.004);
  EXPECT_LT((circle->centre - Eigen::Vector2d(1, 2)).norm(), 0.004);
  EXPECT_FALSE(fit_circle(std::span(places).first(2)));
}

TEST(Arcs, AnArcIsLikelierThanChordsAndAnOctagonThanItsCircle) {
  std::vector<CurvePlace> round, straight;
  std::vector<int> side;
  for (int k = 0; k < 40; ++k) {
    const double angle = 2 * std::numbers::pi * (k + 0.5) / 40;
    const Eigen::Vector2d out(std::cos(angle), std::sin(angle));
    side.push_back(k / 5);
    round.push_back({0.5 * out, 0.003});
    // The side's middle is at an angle of 45 degrees times its number and a half.
    const double to_middle = angle - 2 * std::numbers::pi * (side.back() + 0.5) / 8;
    straight.push_back({0.5 * std::cos(std::numbers::pi / 8) / std::cos(to_middle) * out, 0.003});
  }
  EXPECT_GT(arc_over_lines(round, {{0, 0}, 0.5}, side, {}), 0);
  EXPECT_LT(arc_over_lines(straight, *fit_circle(straight), side, {}), 0);
}

struct ArcFound {
  double length_m = 0, rms_m = 0, worst_turn = 0;
  std::size_t contours = 0;
};

/// Edges within 3 cm of a level circle.
ArcFound on_circle(const ContourMap& map, const Eigen::Vector2d& centre, double radius) {
  ArcFound out;
  std::vector<std::int32_t> contours;
  for (std::size_t i = 0; i < map.points.size(); ++i) {
    const Eigen::Vector2d d = map.position(i).head<2>() - centre;
    const double off = d.norm() - radius, length = map.points[i].length;
    const double turn = std::abs(map.points[i].tangent.head<2>().cast<double>().dot(d.normalized()));
    if (std::abs(off) > 0.03 || turn > 0.5) continue;
    out.length_m += length;
    out.rms_m += off * off * length;
    out.worst_turn = std::max(out.worst_turn, turn);
    contours.push_back(map.points[i].contour);
  }
  std::sort(contours.begin(), contours.end());
  out.contours = static_cast<std::size_t>(std::unique(contours.begin(), contours.end()) - contours.begin());
  out.rms_m = std::sqrt(out.rms_m / out.length_m);
  return out;
}

TEST(Arcs, ADiscHasOneRoundContour) {
  const auto built = build(
      Scan(45).plate(0.6, 0.7, 4000, [](double x, double y) { return std::hypot(x, y) < 0.5; }).cloud());
  ASSERT_TRUE(built) << built.error().line();
  const ArcFound found = on_circle(built->map, {0, 0}, 0.5);
  EXPECT_GT(found.length_m, 0.9 * 2 * std::numbers::pi * 0.5);
  EXPECT_LT(found.rms_m, 0.003);
  EXPECT_LT(found.worst_turn, 0.06);
  EXPECT_EQ(found.contours, 1U);
}

TEST(Arcs, ATablesRoundCornersAreArcsAndItsSidesStraight) {
  const double radius = 0.45, x0 = 0.8, y0 = 0.6;
  const auto built =
      build(Scan(46)
                .plate(0.85, 0.7, 8000,
                       [&](double x, double y) {
                         const Eigen::Vector2d d(std::abs(x) - x0 + radius, std::abs(y) - y0 + radius);
                         return d.cwiseMax(0).norm() < radius && std::abs(x) < x0 && std::abs(y) < y0;
                       })
                .cloud());
  ASSERT_TRUE(built) << built.error().line();
  double round = 0, straight = 0, squares = 0, askew = 0;
  for (std::size_t i = 0; i < built->map.points.size(); ++i) {
    const ContourPoint& p = built->map.points[i];
    if (is_view_dependent(p.kind)) continue;
    const Eigen::Vector2d x = built->map.position(i).head<2>().cwiseAbs();
    const Eigen::Vector2d d = x - Eigen::Vector2d(x0 - radius, y0 - radius);
    const bool at_corner = d.minCoeff() > 0;
    const double off = at_corner ? d.norm() - radius : d.maxCoeff() - radius;
    squares += off * off * static_cast<double>(p.length);
    (at_corner ? round : straight) += static_cast<double>(p.length);
    // Along the curve, wherever it is.
    const Eigen::Vector2d out = at_corner ? d.normalized() : Eigen::Vector2d(d.x() > d.y(), d.x() <= d.y());
    const Eigen::Vector2d along = p.tangent.head<2>().cwiseAbs().cast<double>();
    askew += along.dot(Eigen::Vector2d(out.y(), out.x())) < std::cos(0.25) ? p.length : 0;
  }
  EXPECT_GT(round, 0.7 * 2 * std::numbers::pi * radius);
  EXPECT_GT(straight, 0.7 * 4 * (x0 + y0 - 2 * radius));
  EXPECT_LT(askew, 0.05 * (round + straight));
  EXPECT_LT(std::sqrt(squares / (round + straight)), 0.005);
}

TEST(ViewDependentContours, AreTheSameForAnyNumberOfThreads) {
  const Eigen::Vector3d eye(0.2, -2, 1);
  PointCloud cloud = scene_with_shadow(47, eye);
  cloud.viewpoints = {eye};
  const PointCloud more =
      Scan(48)
          .plate(0.3, 0.7, 4000, [](double x, double y) { return std::hypot(x, y) < 0.3; })
          .cylinder({1, -1, 0}, 0.02, 1, 6000)
          .cloud();
  cloud.points.insert(cloud.points.end(), more.points.begin(), more.points.end());
  const auto one = build(cloud, 1), three = build(cloud, 3);
  ASSERT_TRUE(one && three);
  ASSERT_EQ(one->map.points.size(), three->map.points.size());
  for (std::size_t i = 0; i < one->map.points.size(); ++i) {
    EXPECT_EQ(one->map.points[i].position, three->map.points[i].position);
    EXPECT_EQ(one->map.points[i].kind, three->map.points[i].kind);
    EXPECT_EQ(one->map.points[i].contour, three->map.points[i].contour);
  }
  EXPECT_GT(of_kind(one->map, ContourKind::cylinder_axis).length_m, 0.5);
}

}  // namespace
}  // namespace evpose::map_build
