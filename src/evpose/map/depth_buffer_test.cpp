// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map/depth_buffer.h"

#include <gtest/gtest.h>

namespace evpose {
namespace {

/// A board of 1 x 1 m, 2 cm thick, its front face 2 m before a camera at the origin that looks along z.
ContourMap board() {
  ContourMap map;
  map.anchor = {10, 20, 30};
  for (float z : {2.0F, 2.02F})
    for (const Eigen::Vector2f& c :
         {Eigen::Vector2f(-0.5F, -0.5F), {0.5F, -0.5F}, {0.5F, 0.5F}, {-0.5F, 0.5F}})
      map.occluders.vertices.emplace_back(c.x(), c.y(), z);
  const auto quad = [&](unsigned a, unsigned b, unsigned c, unsigned d) {
    map.occluders.triangles.push_back({a, b, c});
    map.occluders.triangles.push_back({a, c, d});
  };
  quad(0, 1, 2, 3);
  quad(4, 5, 6, 7);
  for (unsigned k = 0; k < 4; ++k) quad(k, (k + 1) % 4, 4 + (k + 1) % 4, 4 + k);
  return map;
}

class DepthBufferLaws : public ::testing::Test {
 protected:
  DepthBufferLaws() : map_(board()) { render_from(Pose{Eigen::Quaterniond::Identity(), map_.anchor}); }
  void render_from(const Pose& T_map_cam) {
    T_map_cam_ = T_map_cam;
    buffer_.render(map_, T_map_cam, 0.1);
  }
  bool hides(const Eigen::Vector3d& relative) const {
    return buffer_.hides(T_map_cam_.inverse() * (map_.anchor + relative));
  }
  ContourMap map_;
  Pose T_map_cam_;
  DepthBuffer buffer_{{1, 1}, 1.0 / 150};
};

TEST_F(DepthBufferLaws, HidesWhatIsBehindAndNothingElse) {
  EXPECT_TRUE(hides({0, 0, 3}));
  EXPECT_TRUE(hides({0.2, -0.3, 2.1}));
  EXPECT_FALSE(hides({0, 0, 1.5})) << "before the board";
  EXPECT_FALSE(hides({0.1, 0.1, 2.0})) << "on the board";
  EXPECT_FALSE(hides({1.2, 0, 3})) << "beside it";
}

TEST_F(DepthBufferLaws, TellsTheDepthExactlyWhereItIsAsked) {
  for (const Eigen::Vector2f& at : {Eigen::Vector2f(0, 0), {0.1034F, -0.2013F}})
    EXPECT_NEAR(*buffer_.depth_at(at), 2, 1e-5);
  EXPECT_FALSE(buffer_.depth_at({0.5F, 0.5F})) << "beside the board";
  EXPECT_FALSE(buffer_.depth_at({3, 0})) << "out of view";
  const double turn = 0.3;  // the board seen askew: depth along the ray (x, y, 1) of the plane z = 2
  render_from(Pose{so3::exp({0, turn, 0}), map_.anchor});
  const Eigen::Vector2f at(-0.2517F, 0.0333F);
  const double z = std::cos(turn) - std::sin(turn) * static_cast<double>(at.x());  // of the ray, in the map
  EXPECT_NEAR(*buffer_.depth_at(at), 2 / z, 1e-4);
}

TEST_F(DepthBufferLaws, NearEdgeOfAThinBoardIsSeenAndItsFarEdgeIsNot) {
  for (double s : {-0.4, 0.0, 0.37}) {
    EXPECT_FALSE(hides({0.5, s, 2.0}));
    EXPECT_FALSE(hides({s, -0.5, 2.0}));
    EXPECT_TRUE(hides({0.5, s, 2.02}));
    EXPECT_TRUE(hides({s, -0.5, 2.02}));
  }
}

TEST_F(DepthBufferLaws, PointsBesideASilhouetteCountAsHidden) {
  // 0.3 cells outside of the silhouette, a metre behind it.
  EXPECT_TRUE(hides(Eigen::Vector3d(0.25 + 0.3 / 150, 0, 1) * 3));
  EXPECT_FALSE(hides(Eigen::Vector3d(0.25 + 4.0 / 150, 0, 1) * 3));
}

TEST_F(DepthBufferLaws, SurfacesThroughTheNearPlaneAreCutNotLost) {
  ContourMap floor;
  floor.occluders.vertices = {{-50, 1, -50}, {50, 1, -50}, {50, 1, 50}, {-50, 1, 50}};
  floor.occluders.triangles = {{0, 1, 2}, {0, 2, 3}};
  buffer_.render(floor, Pose{}, 0.1);
  EXPECT_TRUE(buffer_.hides({0, 1.3, 3}));
  EXPECT_FALSE(buffer_.hides({0, 0.9, 3}));
}

TEST_F(DepthBufferLaws, TurnsWithTheView) {
  render_from(Pose{so3::exp({0, 0.3, 0}), map_.anchor + Eigen::Vector3d(-0.5, 0.2, 0.3)});
  EXPECT_TRUE(hides({0.3, -0.1, 2.5}));
  EXPECT_FALSE(hides({0.0, 0.0, 1.9}));
}

TEST_F(DepthBufferLaws, EmptyMeshHidesNothing) {
  buffer_.render(ContourMap{}, Pose{}, 0.1);
  EXPECT_FALSE(buffer_.hides({0, 0, 30}));
}

}  // namespace
}  // namespace evpose
