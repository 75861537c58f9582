// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/light/panes.h"

#include <gtest/gtest.h>

#include <cmath>

#include "evpose/core/parallel.h"
#include "evpose/sim/light/test_scene.h"
#include "evpose/sim/light/tile_sampler.h"
#include "evpose/sim/light/visible_triangles.h"

namespace evpose::sim {
namespace {

constexpr ImageSize kSize{72, 56};

// The luminance of every pixel, as the simulator samples it.
std::vector<float> image_of(const Scene& scene, const Pose& T_map_cam) {
  ThreadPool pool(1);
  const PreparedScene prepared(scene, pool);
  const std::vector<PixelRay> rays = *pixel_rays(*test_camera(kSize.width, kSize.height, 50));
  std::vector<Tile> tiles;
  for (int y = 0; y < kSize.height; y += kTilePx)
    for (int x = 0; x < kSize.width; x += kTilePx)
      tiles.push_back({x, y, std::min(kTilePx, kSize.width - x), std::min(kTilePx, kSize.height - y)});
  VisibleTriangles visible(prepared, rays, kSize, tiles);
  const SceneView view = make_scene_view(prepared, 0, T_map_cam);
  visible.find(view, view, pool);
  TileSampler sampler(prepared, rays, kSize);
  TileSamples samples;
  std::vector<float> out(rays.size());
  for (std::size_t k = 0; k < tiles.size(); ++k) {
    const TilePlan plan{tiles[k], visible.of_tile(k), {}};
    sampler.set_plan(plan);
    sampler.sample(view, samples);
    for (int y = 0; y < tiles[k].height; ++y)
      for (int x = 0; x < tiles[k].width; ++x)
        out[static_cast<std::size_t>(tiles[k].y0 + y) * kSize.width + tiles[k].x0 + x] =
            samples.luminance[static_cast<std::size_t>(y) * kTilePx + x];
  }
  return out;
}
// Where the ray of a pixel of looking_along_x({0, 0, 0}) is at x = 1.
Eigen::Vector3d direction(std::size_t pixel) {
  const std::size_t column = pixel % kSize.width, row = pixel / kSize.width;
  return {1, (35.5 - static_cast<double>(column)) / 50, (27.5 - static_cast<double>(row)) / 50};
}
double cosine(std::size_t pixel) { return 1 / direction(pixel).norm(); }  // to the x axis

// A wall that fills the view, before a sky that gives no light.
TestScene wall(double luminance) {
  TestScene test;
  test.add({4, -8, -8}, {0, 16, 0}, {0, 0, 16}, luminance);
  return test;
}

TEST(Panes, PlateLightIsFresnels) {
  // Straight on, a face mirrors ((n - 1) / (n + 1))^2 = 0.04 of it.
  const PlateLight straight = plate_light(1, 1.5);
  EXPECT_NEAR(straight.mirrored, 2 * 0.04 / 1.04, 1e-12);
  EXPECT_NEAR(straight.through, 0.96 / 1.04, 1e-12);
  // At Brewster's angle, tan = n, only the light polarised across mirrors, by ((n^2 - 1) / (n^2 + 1))^2.
  const double n2 = 1.5 * 1.5, face = std::pow((n2 - 1) / (n2 + 1), 2);
  EXPECT_NEAR(plate_light(1 / std::sqrt(1 + n2), 1.5).mirrored, face / (1 + face), 1e-12);
  EXPECT_NEAR(plate_light(0, 1.5).mirrored, 1, 1e-12);
  double last = straight.mirrored;
  for (double cosine = 1; cosine >= 0; cosine -= 0.01) {  // nothing is lost, and more is mirrored aslant
    const PlateLight light = plate_light(cosine, 1.5);
    EXPECT_NEAR(light.mirrored + light.through, 1, 1e-12);
    EXPECT_GE(light.mirrored, last - 1e-12);
    last = light.mirrored;
  }
}

// A pane that covers a part of the view, with nothing to mirror: exactly that part is darker, by the angle.
TEST(Panes, AWallThroughAPaneHasTheFractionThatPassesAndPixelsBesideItTheSameBits) {
  constexpr double kWall = 0.6;
  TestScene test = wall(kWall);
  const Pose eye = looking_along_x({0, 0, 0});
  const std::vector<float> bare = image_of(test.scene, eye);
  test.scene.panes = {{{2, -0.4, -0.49}, {0, 1.49, 0}, {0, 0, 0.9}}};
  const std::vector<float> glazed = image_of(test.scene, eye);
  int through = 0;
  for (std::size_t i = 0; i < bare.size(); ++i) {
    const Eigen::Vector3d at = 2 * direction(i);
    if (at.y() > -0.4 && at.y() < 1.09 && at.z() > -0.49 && at.z() < 0.41) {
      EXPECT_NEAR(glazed[i], kWall * plate_light(cosine(i), kGlassIndex).through, 2e-5) << i;
      ++through;
    } else {
      EXPECT_EQ(glazed[i], bare[i]) << i;
    }
  }
  EXPECT_GT(through, 500);
}

TEST(Panes, OneBehindTheOtherLetThroughTheProductAndOneBehindTheWallNothing) {
  TestScene test = wall(0.5);
  const Eigen::Vector3d u(0, 12, 0), v(0, 0, 12);
  test.scene.panes = {{{1, -6, -6}, u, v}, {{5, -6, -6}, u, v}, {{3, -6, -6}, u, v}};
  const std::vector<float> image = image_of(test.scene, looking_along_x({0, 0, 0}));
  for (std::size_t i = 0; i < image.size(); ++i)
    EXPECT_NEAR(image[i], 0.5 * std::pow(plate_light(cosine(i), kGlassIndex).through, 2), 2e-5);
}

// Behind the camera stands a wall whose halves differ; the pane shows it as a plane mirror does.
TEST(Panes, APaneAddsWhatItMirrorsAlsoBeforeTheSky) {
  constexpr double kLeft = 0.9, kRight = 0.2;
  for (const bool before_sky : {false, true}) {
    TestScene test = before_sky ? TestScene() : wall(0.5);
    test.scene.sky_cd_m2 = before_sky ? 0.5 : 0;
    test.add({-1, 0, -9}, {0, 9, 0}, {0, 0, 18}, kLeft);
    test.add({-1, -9, -9}, {0, 9, 0}, {0, 0, 18}, kRight);
    test.scene.panes = {{{2, -5, -5}, {0, 10, 0}, {0, 0, 10}}};
    const std::vector<float> image = image_of(test.scene, looking_along_x({0, 0, 0}));
    for (std::size_t i = 0; i < image.size(); ++i) {
      const double y = 5 * direction(i).y();  // 2 m to the pane and 3 m back
      if (std::abs(y) < 0.1) continue;
      const PlateLight light = plate_light(cosine(i), kGlassIndex);
      EXPECT_NEAR(image[i], light.through * 0.5 + light.mirrored * (y > 0 ? kLeft : kRight), 3e-5) << i;
    }
  }
}

// A pane beside the camera, seen ever more aslant, ends as a mirror of the wall on the camera's side.
TEST(Panes, APaneSeenAslantMirrors) {
  constexpr double kAhead = 0.1, kBeside = 0.8;
  TestScene test;
  test.add({60, 0.5, -40}, {0, 50, 0}, {0, 0, 80}, kAhead);     // behind the pane
  test.add({60, -50, -40}, {0, 50.5, 0}, {0, 0, 80}, kBeside);  // on the side of the camera
  test.scene.panes = {{{-2, 0.5, -40}, {62, 0, 0}, {0, 0, 80}}};
  const std::vector<float> image = image_of(test.scene, looking_along_x({0, 0, 0}));
  for (std::size_t i = 0; i < image.size(); ++i) {
    const Eigen::Vector3d ray = direction(i);
    if (!(60 * ray.y() > 1)) continue;  // the pane
    const PlateLight light = plate_light(ray.y() / ray.norm(), kGlassIndex);
    EXPECT_NEAR(image[i], light.through * kAhead + light.mirrored * kBeside, 3e-5) << i;
  }
  const std::size_t aslant = 27 * kSize.width + 33;  // 87 degrees
  EXPECT_GT(image[aslant], 0.6);
}

TEST(Panes, NearnessAndDistanceAreThoseOfTheRectangle) {
  const Pane pane{{2, -1, -1}, {0, 2, 0}, {0, 0, 2}};
  const auto view = make_pane_view(pane, looking_along_x({0, 0, 0}));
  ASSERT_TRUE(view.has_value());
  using V = Eigen::Vector3d;
  const std::vector<V> ahead = {{-0.1, -0.1, 1}, {0.1, 0.1, 1}}, beside = {{0.6, 0, 1}, {0.7, 0, 1}};
  EXPECT_NEAR(largest_nearness(*view, ahead), 0.5, 1e-6);
  EXPECT_EQ(largest_nearness(*view, beside), 0);
  EXPECT_FALSE(make_pane_view(pane, looking_along_x({2, 5, 0})).has_value());
  EXPECT_NEAR(distance(pane, {0, 0.3, 0.2}), 2, 1e-12);
  EXPECT_NEAR(distance(pane, {2, 4, 5}), 5, 1e-12);
}

}  // namespace
}  // namespace evpose::sim
