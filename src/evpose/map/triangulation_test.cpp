// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "evpose/map/triangulation.h"

namespace evpose {
namespace {

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
}  // namespace evpose
