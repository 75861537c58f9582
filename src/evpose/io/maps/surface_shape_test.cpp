// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/maps/surface_shape.h"

#include <gtest/gtest.h>

#include "evpose/io/files/test_files.h"
#include "evpose/io/maps/contour_files.h"

namespace evpose {
namespace {

/// Points on the faces of a cube of 2 m, along lines so far apart, 2 cm from one to the next, 5 mm off.
std::vector<Eigen::Vector3f> on_a_cube(float line_distance_m) {
  std::vector<Eigen::Vector3f> out;
  unsigned random = 1;
  const auto noise = [&] {
    random = random * 1664525U + 1013904223U;
    return 0.005F * (static_cast<float>(random >> 8) * 0x1p-23F - 1);
  };
  const auto lines = static_cast<int>(2 / line_distance_m);
  for (int face = 0; face < 6; ++face)
    for (int a = 0; a < lines; ++a)
      for (int b = 0; b < 100; ++b) {
        Eigen::Vector3f p;
        p[face % 3] = face < 3 ? -1.0F : 1.0F;
        p[(face + 1) % 3] = static_cast<float>(a) * line_distance_m - 1;
        p[(face + 2) % 3] = static_cast<float>(b) * 0.02F - 1;
        out.emplace_back(p + Eigen::Vector3f(noise(), noise(), noise()));
      }
  return out;
}

TEST(SurfaceShape, FacesAreSurfacesAndLinesAreNot) {
  EXPECT_TRUE(lies_on_surfaces(on_a_cube(0.02F)));
  EXPECT_FALSE(lies_on_surfaces(on_a_cube(0.3F)));
  EXPECT_FALSE(lies_on_surfaces({}));
  EXPECT_FALSE(lies_on_surfaces(std::vector<Eigen::Vector3f>(5000, {1, 2, 3})));
}

TEST(SurfaceShape, ACloudIsNoMapUnlessItSaysThatItIsContours) {
  const TemporaryFolder folder;
  const auto write = [&](const char* columns, const char* values) {
    const auto points = on_a_cube(0.02F);
    std::string ply =
        text("ply\nformat ascii 1.0\nelement vertex ", points.size(),
             "\nproperty float x\nproperty float y\nproperty float z\n", columns, "end_header\n");
    for (const auto& p : points) ply += text(p.x(), " ", p.y(), " ", p.z(), values, "\n");
    return folder.file("cloud.ply", ply);
  };
  EXPECT_TRUE(
      says(error_line(read_contour_map(write("", ""))), {"cloud of surface points", "evpose map build"}));
  const char* tangent = "property float tx\nproperty float ty\nproperty float tz\n";
  EXPECT_TRUE(read_contour_map(write(tangent, " 1 0 0")));
  EXPECT_TRUE(
      says(error_line(read_contour_map(folder.file("scan.las", "LASF of nothing"))), {"evpose map build"}));
}

TEST(SurfaceShape, SharedCloudsAreTold) {
  const std::string data = shared_folder() + "/data/";
  EVPOSE_NEEDS_SHARED(data);
  for (const char* cloud : {"real/clouds/hall_lidar_4cm.ply", "real/clouds/room_laser_scan.ply",
                            "real/clouds/office_rgbd.ply", "peer/maps/room_map_raw.ply"})
    EXPECT_TRUE(says(error_line(read_contour_map(data + cloud)), {"evpose map build"})) << cloud;
  for (const char* edges : {"real/clouds/office_edges_derived.ply", "peer/maps/courtyard_contours.ply"})
    EXPECT_TRUE(read_contour_map(data + edges)) << edges;
}

}  // namespace
}  // namespace evpose
