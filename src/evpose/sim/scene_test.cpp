// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/scene.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "evpose/sim/random.h"
#include "evpose/sim/scene_contours.h"
#include "evpose/sim/test_scene.h"

namespace evpose::sim {
namespace {

TEST(RayBox, HitsAreThoseByHand) {
  const Eigen::Vector3d half(1, 1, 1);
  const auto expect = [&](const Eigen::Vector3d& from, const Eigen::Vector3d& direction, double distance,
                          BoxSide side) {
    const BoxHit hit = hit_box(from, direction, half, 100);
    EXPECT_EQ(hit.side, side) << from.transpose() << " " << direction.transpose();
    EXPECT_NEAR(hit.distance, distance, 1e-15);
  };
  expect({-3, 0.2, 0.1}, {1, 0, 0}, 2, 0);
  expect({3, 0.2, 0.1}, {-0.5, 0, 0}, 4, 1);
  expect({-2, -3, 0}, {1, 1, 0}, 2, 2);  // enters x = -1 at 1, y = -1 at 2
  expect({0, 0, 0}, {0, 2, 0}, 0.5, 3);  // from inside: where it leaves
  expect({0.5, 0, 0}, {0.1, 0, -1}, 1, 4);
  expect({-3, 1.2, 0}, {1, 0, 0}, 0, -1);  // parallel, beside
  expect({-3, 0, 0}, {-1, 0, 0}, 0, -1);   // behind
  expect({-3, 0, 0}, {1, 1, 0}, 0, -1);    // passes a corner
  EXPECT_EQ(hit_box({-3, 0, 0}, {1, 0, 0}, half, 1.9).side, -1);
}

TEST(Scene, TurnedBoxIsHitAtItsOwnSide) {
  const Scene scene = test_scene({{{0, 0, 0}, {1, 1, 1}, 45, 0.5}});
  const auto hit = scene.trace({-2, 0.1, 0}, {1, 0, 0});
  ASSERT_TRUE(hit);
  EXPECT_NEAR(hit->distance, 2 - (std::sqrt(0.5) - 0.1),
              1e-12);  // |x| + |y| = sqrt(1/2) on the square's sides
  const Eigen::Vector3d normal = scene.normal(hit->face);
  EXPECT_LT((normal - Eigen::Vector3d(-1, 1, 0).normalized()).norm(), 1e-12);
}

TEST(Texture, MeanIsTheAverageOfTheTexelsItCovers) {
  const Texture board(2, 1, 0.25,
                      [](double u, double v) { return (int(u * 4) + int(v * 4)) & 1 ? 1.0 : 0.2; });
  EXPECT_NEAR(board.mean(0.125, 0.125, 0, 0), 0.2, 1e-9);                       // one texel
  EXPECT_NEAR(board.mean(0.375, 0.125, 0.25, 0.25), 1, 1e-9);                   // the next
  EXPECT_NEAR(board.mean(0.25, 0.125, 0.25, 0.25), 0.6, 1e-9);                  // half of each
  EXPECT_NEAR(board.mean(1, 0.5, 2, 1), 0.6, 1e-9);                             // all
  EXPECT_NEAR(board.mean(1, 0.5, 9, 9), 0.6, 1e-9);                             // cut at the border
  EXPECT_NEAR(board.mean(0.375, 0.125, 0.375, 0.25), 0.2 / 3 + 2.0 / 3, 1e-9);  // 0.25 / 0.375 of it white
}

TEST(Texture, MeanIsContinuous) {
  const Texture t(1, 1, 0.01, [](double u, double v) { return u * 50 - std::floor(u * 50) > v ? 0.9 : 0.1; });
  for (double u = -0.05; u < 1.05; u += 1e-4)
    EXPECT_LT(std::abs(t.mean(u + 1e-4, 0.4, 0.02, 0.01) - t.mean(u, 0.4, 0.02, 0.01)), 0.011) << u;
}

TEST(BoxRoom, NoBoxCutsAnother) {
  const Scene scene = make_box_room(1);
  Random random(5);
  for (std::size_t b = 1; b < scene.boxes.size(); ++b) {
    const Box& box = scene.boxes[b];
    for (int i = 0; i < 3000; ++i) {
      Eigen::Vector3d inside;
      for (int k = 0; k < 3; ++k) inside[k] = random.uniform(-1, 1) * (box.half[k] - 1e-6);
      const Eigen::Vector3d point = box.T_map_box * inside;
      for (std::size_t other = 0; other < scene.boxes.size(); ++other) {
        if (other == b) continue;
        const Eigen::Vector3d p = (scene.boxes[other].T_map_box.inverse() * point).cwiseAbs();
        EXPECT_EQ((p.array() < scene.boxes[other].half.array()).all(), other == 0) << b << " and " << other;
      }
    }
  }
}

double total_length(const ContourMap& map) {
  double sum = 0;
  for (const ContourPoint& p : map.points) sum += p.length;
  return sum;
}

TEST(Contours, LengthIsThatOfTheCreasesByHand) {
  constexpr double kRoom = 4 * (6 + 6 + 6);
  const double spacing = 0.01, slack = 0.021;  // a point's length at each end of a run
  EXPECT_NEAR(total_length(make_contours(test_scene({}), spacing)), kRoom, 1e-3);
  // In the air: 12 edges.
  const Scene floating = test_scene({{{0, 0, 0}, {1, 0.5, 0.3}, 20, 0.5}});
  EXPECT_NEAR(total_length(make_contours(floating, spacing)), kRoom + 4 * 1.8, 1e-3);
  // On the floor: its lower edges are creases with the floor.
  const Scene standing = test_scene({{{0, 0, -2.85}, {1, 0.5, 0.3}, 20, 0.5}});
  EXPECT_NEAR(total_length(make_contours(standing, spacing)), kRoom + 4 * 1.8, 1e-3);
  // In a corner of the room: three of its edges coincide with the room's, and both are buried.
  const Scene corner = test_scene({{{-2.5, -2.75, -2.85}, {1, 0.5, 0.3}, 0, 0.5}});
  EXPECT_NEAR(total_length(make_contours(corner, spacing)), kRoom - 1.8 + 3 * 1.8, 9 * slack);
  // Two boxes side by side, flush: the four edges of the seam go.
  const Scene flush = test_scene({{{0, 0, 0}, {1, 1, 1}, 0, 0.5}, {{1, 0, 0}, {1, 1, 1}, 0, 0.5}});
  EXPECT_NEAR(total_length(make_contours(flush, spacing)), kRoom + 2 * 12 - 8, 9 * slack);
}

TEST(Contours, NormalsPointOutOfAFaceAcrossTheEdge) {
  const Scene scene = make_box_room(1);
  const ContourMap map = make_contours(scene, 0.05);
  ASSERT_GT(map.points.size(), 2000u);
  for (std::size_t i = 0; i < map.points.size(); ++i) {
    const ContourPoint& p = map.points[i];
    const Eigen::Vector3d normal = p.normal.cast<double>(), tangent = p.tangent.cast<double>();
    EXPECT_NEAR(normal.norm(), 1, 1e-6);
    EXPECT_NEAR(tangent.norm(), 1, 1e-6);
    EXPECT_NEAR(normal.dot(tangent), 0, 1e-6);
    EXPECT_NEAR(normal.dot(scene.normal(p.plane_a)), 0, 1e-6);   // in plane a
    EXPECT_NEAR(tangent.dot(scene.normal(p.plane_b)), 0, 1e-6);  // the edge lies in both
    // Against the normal one stays beside plane a in free space; along it something else comes.
    const Eigen::Vector3d beside = map.position(i) + 1e-4 * scene.normal(p.plane_a);
    EXPECT_FALSE(scene.solid(beside - 1e-3 * normal));
    EXPECT_TRUE(scene.solid(map.position(i) - 1e-4 * scene.normal(p.plane_a) - 1e-3 * normal));
  }
}

}  // namespace
}  // namespace evpose::sim
