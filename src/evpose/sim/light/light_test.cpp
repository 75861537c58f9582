// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <numbers>

#include "evpose/core/parallel.h"
#include "evpose/sim/light/prepared_scene.h"
#include "evpose/sim/light/scene_view.h"
#include "evpose/sim/light/test_scene.h"
#include "evpose/sim/world/random.h"
#include "evpose/sim/world/texture.h"

namespace evpose::sim {
namespace {

TEST(PixelRays, FractionAboveIsTheAreaOfTheCutSquare) {
  Random random(1);
  for (int trial = 0; trial < 50; ++trial) {
    const auto level = static_cast<float>(random.uniform(-1, 1));
    const Eigen::Vector2f slope(static_cast<float>(random.uniform(-1, 1)),
                                static_cast<float>(random.uniform(-1, 1)));
    int above = 0;
    constexpr int kSide = 400;
    for (int i = 0; i < kSide * kSide; ++i) {
      const float x = (static_cast<float>(i % kSide) + 0.5F) / kSide - 0.5F;
      const float y = (static_cast<float>(i / kSide) + 0.5F) / kSide - 0.5F;
      if (level + slope.x() * x + slope.y() * y > 0) ++above;
    }
    EXPECT_NEAR(fraction_above(level, slope), above / static_cast<double>(kSide * kSide), 4e-3);
  }
  EXPECT_EQ(fraction_above(0.2F, {0, 0}), 1);
  EXPECT_EQ(fraction_above(-0.2F, {0, 0}), 0);
  EXPECT_FLOAT_EQ(fraction_above(0.25F, {1, 0}), 0.75F);
}

// A wave along u with a period of 16 texels, on a rectangle whose texels do not halve evenly.
TEST(Texture, MeanOverAFootprintIsThatOfThePattern) {
  constexpr double kPeriod = 0.048;
  const Texture texture(10 * kPeriod, 0.33, 0.003, [](double u, double) {
    return 0.5 + 0.4 * std::sin(2 * std::numbers::pi * u / kPeriod);
  });
  const auto wave = [](double u, double width) {
    const double k = std::numbers::pi * width / kPeriod;
    return 0.5 + 0.4 * std::sin(2 * std::numbers::pi * u / kPeriod) * (k > 0 ? std::sin(k) / k : 1);
  };
  for (const float u : {0.01F, 0.1F, 0.317F, 0.477F}) {
    // As fine as a texel, and on a repeat of the rectangle.
    EXPECT_NEAR(texture.mean(u, 0.1F, {0.003F, 0}, {0, 0.003F}), wave(u, 0.003), 0.02);
    EXPECT_NEAR(texture.mean(u - 0.48F, 0.1F + 0.33F, {0.003F, 0}, {0, 0.003F}), wave(u, 0.003), 0.02);
    // A slanted surface: long along v, where nothing changes, or along u, where it averages out.
    EXPECT_NEAR(texture.mean(u, 0.1F, {0.003F, 0}, {0, 0.02F}), wave(u, 0.003), 0.03);
    EXPECT_NEAR(texture.mean(u, 0.1F, {0.048F, 0}, {0, 0.006F}), 0.5, 0.06);
    EXPECT_NEAR(texture.mean(u, 0.1F, {0.4F, 0.1F}, {-0.1F, 0.3F}), 0.5, 0.05);
  }
}

TEST(Surfaces, RectanglesAreOnePatchAndBoxesSix) {
  TestScene plain;
  const int grey = plain.material(0.5);
  TestScene::add_box(plain.scene.mesh, {0, 0, 0}, {1, 2, 3}, grey);
  std::int32_t first = 0;
  const PartSurfaces surfaces = segment_surfaces(plain.scene.mesh, first);
  ASSERT_EQ(surfaces.patches.size(), 6U);
  EXPECT_EQ(first, 12);
  for (std::size_t i = 0; i < 12; ++i) {
    // One edge of each triangle is the rectangle's diagonal.
    EXPECT_EQ(std::popcount(surfaces.edges[i]), 2);
    const Patch& patch = surfaces.patches[surfaces.patch_of[i]];
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3d p = plain.scene.mesh.vertices[plain.scene.mesh.triangles[i][k]].cast<double>();
      EXPECT_NEAR(patch.normal.dot(p) + patch.offset, 0, 1e-6);
      EXPECT_NEAR(patch.u_axis.dot(p) + patch.u0, plain.scene.mesh.uv[i][k].x(), 1e-5);
      EXPECT_NEAR(patch.v_axis.dot(p) + patch.v0, plain.scene.mesh.uv[i][k].y(), 1e-5);
    }
    EXPECT_GT(patch.normal.dot(plain.scene.mesh.vertices[plain.scene.mesh.triangles[i][0]].cast<double>() -
                               Eigen::Vector3d(0.5, 1, 1.5)),
              0);
  }
}

// What a lamp gives follows from its distance; nothing comes through a plate, half a lamp past its rim.
TEST(Lighting, LampFollowsTheSquareOfDistanceAndThrowsShadows) {
  TestScene plain;
  plain.add({2, -1, -1}, {0, 0, 2}, {0, 2, 0}, 1);
  plain.add({1, 0.1, -1}, {0, 0, 2}, {0, 0.9, 0}, 1);  // hides the lamp from y > 0.2 on the wall
  Light& lamp = plain.scene.lights[0];
  lamp.kind = LightKind::lamp;
  lamp.strength = 100;
  lamp.position = {0, 0, 0};
  lamp.radius = 0.02;
  ThreadPool pool(1);
  const PreparedScene prepared(plain.scene, pool);
  const SceneView view = make_scene_view(prepared, 0, looking_along_x({1.5, 0, 0}));
  const auto at = [&](double y, double z) {
    const PixelRay ray{
        Eigen::Vector2f(static_cast<float>(-y / 0.5), static_cast<float>(-z / 0.5)), {1e-3F, 0}, {0, 1e-3F}};
    return static_cast<double>(
               luminance(prepared, view, make_patch_view(view, prepared.still.patches[0], -1), ray)) *
           std::numbers::pi;
  };
  for (const double y : {-0.5, -0.1, 0.1}) {
    for (const double z : {-0.4, 0.3}) {
      const double r2 = 4 + y * y + z * z;
      EXPECT_NEAR(at(y, z), 100 / r2 * 2 / std::sqrt(r2), 0.05) << y << " " << z;
    }
  }
  EXPECT_NEAR(at(0.3, 0), 0, 1e-6);
  EXPECT_NEAR(at(0.2, 0) / (100 / 4.04 * 2 / std::sqrt(4.04)), 0.5, 0.2);
}

// Contact shadow: a floor at the foot of a long wall sees 1/2 (1 + d / sqrt(d^2 + h^2)) of an even sky.
TEST(Lighting, AmbientLightFallsTowardsAContactByTheViewOfTheSky) {
  constexpr double kHeight = 0.5, kFloor = 0.6;
  TestScene test;
  test.add({0, -3, 0}, {2, 0, 0}, {0, 6, 0}, kFloor);
  test.add({2, 3, 0}, {0, -6, 0}, {0, 0, kHeight}, 0.4);
  ThreadPool pool(1);
  const PreparedScene prepared(test.scene, pool);
  const SceneView view = make_scene_view(prepared, 0, looking_along_x({0, 0, 1}));
  double last = 0;
  for (const double d : {0.01, 0.03, 0.06, 0.1, 0.2, 0.4, 0.8}) {
    const double x = 2 - d;
    const PixelRay ray{{0, static_cast<float>(1 / x)}, {1e-4F, 0}, {0, 1e-4F}};
    const double seen = static_cast<double>(luminance(
                            prepared, view, make_patch_view(view, prepared.still.patches[0], -1), ray)) /
                        kFloor;
    EXPECT_NEAR(seen, 0.5 * (1 + d / std::hypot(d, kHeight)), 0.06) << d;  // 24 rays
    EXPECT_GE(seen, last - 1e-6);
    last = seen;
  }
}

// In a large place, whose texels are coarse: shadows of the sun have exact rims near the feet of things, even
// of a post that no coarse texel sees, and the sky is hidden as exactly as in a small place.
TEST(Lighting, ShadowsOnLargeGroundsAreSharpAtTheFeetOfThings) {
  constexpr double kSide = 100, kFloor = 0.6, kPost = 0.06;
  TestScene test;
  test.add({-kSide / 2, -kSide / 2, 0}, {kSide, 0, 0}, {0, kSide, 0}, kFloor);
  TestScene::add_box(test.scene.mesh, {2, -0.5, 0}, {1, 1, 1}, test.material(0.4));
  TestScene::add_box(test.scene.mesh, {2, 3.013, 0}, {kPost, kPost, 1}, test.material(0.4));
  Light& sun = test.scene.lights[0];
  sun.kind = LightKind::sun;
  sun.strength = std::numbers::pi;
  sun.radius = 0.005;
  sun.direction =
      Eigen::Vector3d(-1, 0, -1).normalized();  // shadows fall towards -x, as long as things are high
  ThreadPool pool(2);
  const PreparedScene prepared(test.scene, pool);
  const LightMap& map = prepared.still.patches[0].light;
  EXPECT_GE(map.per_metre, 1 / 0.03);
  const SceneView view = make_scene_view(prepared, 0, looking_along_x({0, 0, 2}));
  const auto sunlit = [&](double x, double y) {  // fraction
    const PixelRay ray{{static_cast<float>(-y / x), static_cast<float>(2 / x)}, {1e-5F, 0}, {0, 1e-5F}};
    return static_cast<double>(
               luminance(prepared, view, make_patch_view(view, prepared.still.patches[0], -1), ray)) /
           (kFloor * std::sqrt(0.5));
  };
  constexpr double kOff = 0.04;
  for (const double x : {1.96, 1.9, 1.7, 1.5, 1.2}) {  // beside the shadow of the box, and in it
    for (const double side : {-1.0, 1.0}) {
      EXPECT_NEAR(sunlit(x, side * (0.5 + kOff)), 1, 0.02) << x << " " << side;
      EXPECT_NEAR(sunlit(x, side * (0.5 - kOff)), 0, 0.02) << x << " " << side;
    }
  }
  for (const double x : {1.95, 1.85, 1.7, 1.5, 1.3}) {  // along the shadow of the post
    EXPECT_LT(sunlit(x, 3.013 + kPost / 2), 0.3) << x;
    EXPECT_NEAR(sunlit(x, 3.013 - kOff), 1, 0.02) << x;
    EXPECT_NEAR(sunlit(x, 3.013 + kPost + kOff), 1, 0.02) << x;
  }
  EXPECT_NEAR(sunlit(1.0 - kOff, 0), 1, 0.03);  // its end
  EXPECT_NEAR(sunlit(1.0 + kOff, 0), 0, 0.03);
}

TEST(Lighting, SwitchingIsAFactorOfTime) {
  LightSwitching s;
  EXPECT_EQ(s.factor(3), 1);
  s.off_at_s = 1;
  s.on_at_s = 2;
  s.off_factor = 0.1;
  s.fade_s = 0.01;
  EXPECT_DOUBLE_EQ(s.factor(0.999), 1);
  EXPECT_NEAR(s.factor(1.005), 0.55, 1e-9);
  EXPECT_NEAR(s.factor(1.5), 0.1, 1e-9);
  EXPECT_NEAR(s.factor(2.02), 1, 1e-9);
  EXPECT_DOUBLE_EQ(s.next_switch_s(0), 1);
  EXPECT_DOUBLE_EQ(s.next_switch_s(1), 2);
  EXPECT_LT(s.step_s(1.001), 1e-3);
}

// A pixel's mean through the whole path: distance and slant change the footprint, never the mean brightness.
TEST(SceneView, PlainWallHasOneLuminanceFromEverywhere) {
  TestScene plain;
  plain.add({2, -1, -1}, {0, 0, 2}, {0, 2, 0}, 0.4);
  ThreadPool pool(1);
  const PreparedScene prepared(plain.scene, pool);
  const auto camera = test_camera(32, 24, 60);
  const auto rays = pixel_rays(*camera);
  ASSERT_TRUE(rays.ok());
  for (const double yaw : {-0.5, 0.0, 0.7}) {
    Pose pose = looking_along_x({1, 0.1, 0.2});
    pose.q = so3::exp({0, 0, yaw}) * pose.q;
    const SceneView view = make_scene_view(prepared, 0, pose);
    for (const PixelRay& ray : *rays)
      EXPECT_NEAR(luminance(prepared, view, make_patch_view(view, prepared.still.patches[0], -1), ray), 0.4,
                  1e-5);
  }
}

// A floor with a clear coat before a wall whose upper half is bright.
TEST(SceneView, ACoatMirrorsBySchlicksLawWhatTheMirroredRayMeets) {
  constexpr double kCoat = 0.04, kFloor = 0.2, kLow = 0.1, kHigh = 0.8;
  TestScene test;
  test.add({-1, -5, 0}, {6, 0, 0}, {0, 10, 0}, kFloor);
  test.scene.materials.back().mirror = kCoat;
  test.add({4, 5, 0}, {0, -10, 0}, {0, 0, 1}, kLow);
  test.add({4, 5, 1}, {0, -10, 0}, {0, 0, 1}, kHigh);
  ThreadPool pool(1);
  const PreparedScene prepared(test.scene, pool);
  constexpr double kEye_m = 1.2;
  const SceneView view = make_scene_view(prepared, 0, looking_along_x({0, 0, kEye_m}));
  const auto lit = [&](double x, double y, double z, int patch) {  // seen point: its own luminance
    const PixelRay ray{
        {static_cast<float>(-y / x), static_cast<float>((kEye_m - z) / x)}, {1e-4F, 0}, {0, 1e-4F}};
    return static_cast<double>(
        luminance(prepared, view, make_patch_view(view, prepared.still.patches[patch], -1), ray));
  };
  const auto patch_at = [&](double x, double y, double z) {
    const auto hit = prepared.rays.trace({0, 0, kEye_m}, Eigen::Vector3d(x, y, z - kEye_m));
    return prepared.still.patch_of[hit->triangle];
  };
  for (const double x : {0.5, 1.0, 1.7, 2.0, 2.3, 3.0, 3.5}) {
    for (const double y : {-0.7, 0.0, 0.4}) {
      const int floor = patch_at(x, y, 0);
      // The mirrored ray rises as steeply as the direct one falls.
      const double up = kEye_m / x * (4 - x);
      const double across = y / x * 4;
      const double cosine = kEye_m / std::sqrt(kEye_m * kEye_m + x * x + y * y);
      const double coat = kCoat + (1 - kCoat) * std::pow(1 - cosine, 5);
      const double mirrored = up > 2 ? 0 : lit(4, across, up, patch_at(4, across, up));
      if (std::abs(up - 1) < 0.01 || std::abs(up - 2) < 0.01) continue;
      test.scene.materials[0].mirror = 0;
      const double matt = lit(x, y, 0, floor);
      test.scene.materials[0].mirror = kCoat;
      EXPECT_NEAR(lit(x, y, 0, floor), (1 - coat) * matt + coat * mirrored, 2e-4) << x << " " << y;
    }
  }
}

}  // namespace
}  // namespace evpose::sim
