// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/light/tile_sampler.h"

#include <gtest/gtest.h>

#include <cmath>

#include "evpose/core/parallel.h"
#include "evpose/sim/light/test_scene.h"
#include "evpose/sim/light/visible_triangles.h"
#include "evpose/sim/world/random.h"
#include "evpose/sim/world/texture.h"

namespace evpose::sim {
namespace {

constexpr ImageSize kSize{72, 56};  // not a multiple of a tile

// Boxes of all sizes before a wall, some of them beside and behind the camera.
Scene cluttered() {
  TestScene plain;
  plain.add({6, -6, -6}, {0, 0, 12}, {0, 12, 0}, 0.5);
  Random random(5);
  for (int i = 0; i < 50; ++i) {
    const double x = random.uniform(0, 5.5), spread = 0.3 + 0.6 * std::abs(x);
    const double side = 0.1 * (1 + std::abs(x)) * random.uniform(0.5, 2);
    TestScene::add_box(
        plain.scene.mesh, {x, random.uniform(-spread, spread), random.uniform(-spread, spread)},
        {side, side * random.uniform(0.3, 1), side}, plain.material(random.uniform(0.05, 0.9)));
  }
  plain.scene.sky_cd_m2 = 2;
  return plain.scene;
}

struct Place {
  explicit Place(double blur_px = 0, Scene of = cluttered())
      : pool(1),
        scene(std::move(of)),
        prepared(scene, pool),
        camera(test_camera(kSize.width, kSize.height, 50)) {
    rays = *pixel_rays(*camera, blur_px);
    for (int y = 0; y < kSize.height; y += kTilePx)
      for (int x = 0; x < kSize.width; x += kTilePx)
        tiles.push_back({x, y, std::min(kTilePx, kSize.width - x), std::min(kTilePx, kSize.height - y)});
  }
  SceneView view(double way) const {
    Pose pose = looking_along_x({-0.3 + 0.2 * way, 0.05 * way, 0.02});
    pose.q = so3::exp({0, 0, 0.05 * way}) * pose.q;
    return make_scene_view(prepared, 0, pose);
  }
  // Depth along a ray of the camera, 0: sky.
  float depth(const SceneView& at, const Eigen::Vector3f& direction) const {
    const auto hit = prepared.rays.trace(at.T_map_cam.p, at.R_map_cam * direction.cast<double>());
    return hit ? hit->distance : 0;
  }

  ThreadPool pool;
  Scene scene;
  PreparedScene prepared;
  std::shared_ptr<const Camera> camera;
  std::vector<PixelRay> rays;
  std::vector<Tile> tiles;
};

// The rasteriser finds what rays find, at both ends of a motion and in between.
TEST(TileRaster, SeesWhatRaysSee) {
  const Place place;
  VisibleTriangles visible(place.prepared, place.rays, kSize, place.tiles);
  ThreadPool pool(2);
  // A tenth of the way is 0.25 px of turn and up to a few pixels of approach.
  const SceneView from = place.view(0), to = place.view(0.3);
  visible.find(from, to, pool);
  TileRaster raster;
  int seen = 0, different = 0, nearer = 0;
  for (const double way : {0.0, 0.1, 0.2, 0.3}) {
    const SceneView at = place.view(way);
    for (std::size_t k = 0; k < place.tiles.size(); ++k) {
      raster.set_tile(place.rays, kSize, place.tiles[k]);
      raster.draw(place.prepared, at, visible.of_tile(k));
      for (std::size_t i = 0; i < TileRaster::kPlaces; ++i) {
        const Eigen::Vector3f direction(raster.x()[i], raster.y()[i], 1);
        const float wanted = place.depth(at, direction);
        const std::int32_t shape = raster.shape()[i];
        const float found = shape == kSky ? 0 : 1 / raster.shapes()[shape].plane.nearness.dot(direction);
        ++seen;
        different += !(std::abs(found - wanted) <= 1e-3F * wanted);
        nearer += wanted > 0 && 1 / wanted > 1.001F * raster.largest_nearness();
      }
    }
  }
  EXPECT_GT(seen, 30000);
  EXPECT_LE(different, seen / 5000);  // rays that meet an edge within rounding
  EXPECT_LE(nearer, seen / 5000);
}

// The luminance of a pixel is its mean over many rays.
void expect_mean_of_rays(double blur_px) {
  const Place place(blur_px);
  VisibleTriangles visible(place.prepared, place.rays, kSize, place.tiles);
  ThreadPool pool(1);
  const SceneView at = place.view(0);
  visible.find(at, at, pool);
  TileSampler sampler(place.prepared, place.rays, kSize);
  TileSamples samples;
  constexpr int kSide = 24;
  double sum = 0, of_borders = 0;
  int pixels = 0, borders = 0;
  for (std::size_t k = 0; k < place.tiles.size(); ++k) {
    const Tile& tile = place.tiles[k];
    const TilePlan plan{tile, visible.of_tile(k), {}};
    sampler.set_plan(plan);
    sampler.sample(at, samples);
    for (int y = 0; y < tile.height; ++y) {
      for (int x = 0; x < tile.width; ++x) {
        const std::size_t i = static_cast<std::size_t>(y) * kTilePx + x;
        double wanted = 0;
        for (int n = 0; n < kSide * kSide; ++n) {
          const int column = n % kSide, row = n / kSide;
          const float dx = (static_cast<float>(column) + 0.5F) / kSide - 0.5F,
                      dy = (static_cast<float>(row) + 0.5F) / kSide - 0.5F;
          const PixelRay& ray = sampler.ray(i);
          const auto hit =
              place.prepared.rays.trace(at.T_map_cam.p, at.R_map_cam * ray.direction(dx, dy).cast<double>());
          if (!hit) {
            wanted += place.scene.sky_cd_m2;
            continue;
          }
          const PatchView patch = make_patch_view(at, place.prepared.patch_of(*hit), -1);
          wanted += static_cast<double>(luminance(place.prepared, at, patch, ray, dx, dy));
        }
        const double error = std::abs(samples.luminance[i] - wanted / (kSide * kSide));
        sum += error;
        ++pixels;
        if (samples.border[i] >= 0 && samples.borders[samples.border[i]].other != kMany) {
          of_borders += error;
          ++borders;
        }
      }
    }
  }
  EXPECT_GT(borders, 300);
  EXPECT_LT(of_borders / borders, 0.012);
  EXPECT_LT(sum / pixels, 0.006);  // things smaller than a pixel may lie between its corners
}
TEST(TileSampler, LuminanceIsTheMeanOverThePixel) { expect_mean_of_rays(0); }
TEST(TileSampler, BlurredLuminanceIsTheMeanOverTheWiderArea) { expect_mean_of_rays(0.6); }

// The response of a pixel to a step edge, printed or of a thing before a wall, upright or slanted, is a
// distribution over the place of the edge: it has the variance of the pixel and of the blur.
TEST(TileSampler, StepResponseHasTheVarianceOfThePixelAndTheBlur) {
  constexpr double kStep_px = 0.04, kPxPerM = 25;
  constexpr int kX = 40, kY = 24;
  for (const double blur_px : {0.0, 0.3, 0.7}) {
    for (const double wall_m : {2.0, 4.0}) {
      TestScene plain;
      plain.add({2, 0, -3}, {0, 0, 6}, {0, 3, 0}, 0.6);
      plain.add({wall_m, -5, -5}, {0, 0, 10}, {0, wall_m > 2 ? 10.0 : 5.0, 0}, 0.1);
      const Place place(blur_px, plain.scene);
      VisibleTriangles visible(place.prepared, place.rays, kSize, place.tiles);
      ThreadPool pool(1);
      TileSampler sampler(place.prepared, place.rays, kSize);
      TileSamples samples;
      for (const double roll : {0.0, 0.4}) {
        double last = 0, sum = 0, first = 0, second = 0;
        // The pixel is off the axis by this, across the edge.
        const double off_px = std::cos(roll) * (kX - 35.5) - std::sin(roll) * (kY - 27.5);
        for (int k = -55; k <= 55; ++k) {
          const double edge_px = kStep_px * k;  // from the pixel
          Pose pose = looking_along_x({0, (off_px + edge_px) / kPxPerM, 0});
          pose.q = pose.q * so3::exp({0, 0, roll});
          const SceneView at = make_scene_view(place.prepared, 0, pose);
          visible.find(at, at, pool);
          const std::size_t tile = kY / kTilePx * ((kSize.width + kTilePx - 1) / kTilePx) + kX / kTilePx;
          const TilePlan plan{place.tiles[tile], visible.of_tile(tile), {}};
          sampler.set_plan(plan);
          sampler.sample(at, samples);
          const double seen = static_cast<double>(samples.luminance[kY % kTilePx * kTilePx + kX % kTilePx]);
          if (k > -55) {
            const double middle = edge_px - 0.5 * kStep_px;
            sum += seen - last;
            first += (seen - last) * middle;
            second += (seen - last) * middle * middle;
          }
          last = seen;
        }
        EXPECT_NEAR(std::abs(sum), 0.5, 1e-4);
        EXPECT_NEAR(first / sum, 0, 0.01) << blur_px << " " << wall_m << " " << roll;
        const double variance = second / sum - std::pow(first / sum, 2);
        EXPECT_NEAR(variance, 1.0 / 12 + blur_px * blur_px, 0.003) << blur_px << " " << wall_m << " " << roll;
      }
    }
  }
}

// Eight directions at once have the luminance of each, with texture, two channels of light, a coat and a
// pane.
TEST(SceneView, LuminanceOfEightIsThatOfEach) {
  TestScene plain;
  plain.add({2, -1, -1}, {0, 0, 2}, {0, 2, 0}, 0.8);
  plain.scene.materials.back().texture = std::make_shared<const Texture>(
      0.5, 0.5, 0.01, [](double u, double v) { return 0.5 + 0.4 * std::sin(25 * u) * std::sin(25 * v); });
  Light lamp = plain.scene.lights[0];
  lamp.kind = LightKind::lamp;
  lamp.strength = 50;
  lamp.position = {0, 0.5, 0};
  lamp.switching.flicker_hz = 100;
  lamp.switching.flicker_depth = 0.3;
  plain.scene.lights.push_back(lamp);
  // A coat, a pane before a part of it, and behind the camera what they mirror.
  plain.scene.materials.back().mirror = 0.04;
  plain.scene.panes = {{{1.2, -0.2, -1}, {0, 0.6, 0}, {0, 0, 2}}};
  for (int i = 0; i < 9; ++i) plain.add({-1, 0.4 * i - 2, -2}, {0, 0.4, 0}, {0, 0, 4}, 0.1 * i);
  ThreadPool pool(1);
  const PreparedScene prepared(plain.scene, pool);
  ASSERT_EQ(prepared.channels.switching.size(), 2U);
  const SceneView view = make_scene_view(prepared, 0.0021, looking_along_x({0.5, 0.1, 0.2}));
  const PatchView patch = make_patch_view(view, prepared.still.patches[0], -1);
  Random random(2);
  for (int trial = 0; trial < 500; ++trial) {
    RayAreas<FloatLanes> areas;
    std::array<RayAreas<float>, kLanes> each;
    for (int i = 0; i < kLanes; ++i) {
      const auto any = [&](double most) { return static_cast<float>(random.uniform(-most, most)); };
      each[i] = {any(0.6), any(0.6), any(0.01), any(0.002), any(0.002), any(0.01)};
      areas.x[i] = each[i].x, areas.y[i] = each[i].y;
      areas.column_x[i] = each[i].column_x, areas.column_y[i] = each[i].column_y;
      areas.row_x[i] = each[i].row_x, areas.row_y[i] = each[i].row_y;
    }
    const FloatLanes together = luminance(prepared, view, patch, areas);
    for (int i = 0; i < kLanes; ++i)
      ASSERT_EQ(static_cast<float>(together[i]), luminance(prepared, view, patch, each[i]));
  }
}

}  // namespace
}  // namespace evpose::sim
