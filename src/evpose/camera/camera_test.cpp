// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/camera/camera.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>

namespace evpose {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

std::shared_ptr<const Camera> camera(const std::string& model, std::vector<double> distortion,
                                     double focal = 381, ImageSize size = {640, 480}) {
  CameraIntrinsics c{
      focal, 1.0008 * focal, 0.5 * size.width + 2.4, 0.5 * size.height - 3.1, model, std::move(distortion),
      size};
  auto made = make_camera(c);
  EXPECT_TRUE(made.ok()) << (made.ok() ? "" : made.error().line());
  return made.value();
}

struct Named {
  std::string name;
  std::shared_ptr<const Camera> camera;
};

// Calibrations of the peer recordings (VGA, landing alike; 720p), of public data sets, and extremes.
std::vector<Named> cameras() {
  const std::vector<double> peer = {-0.1, 0.02, 0.0005, -0.0003};
  return {
      {"none", camera("none", {})},
      {"peer 640x480", camera("radtan", peer)},
      {"peer 1280x720", camera("radtan", peer, 763, {1280, 720})},
      {"DAVIS240 radtan",
       camera("radtan", {-0.368436, 0.150947, -0.000296130, -0.000759431}, 199, {240, 180})},
      {"radtan k3", camera("radtan", {-0.3, 0.12, 1e-3, -2e-3, -0.02}, 420)},
      {"strong tangential", camera("radtan", {0.02, 0.01, 0.02, -0.03}, 420)},
      {"DAVIS346 equidistant",
       camera("equidistant", {-0.0480314, 0.0113310, -0.0553782, 0.0215010}, 226.4, {346, 260})},
      {"ideal equidistant", camera("equidistant", {0, 0, 0, 0}, 200)},
      {"fisheye of 200 degrees", camera("equidistant", {-0.01, 0.002, -0.001, 0.0001}, 170)},
      {"EuRoC double sphere", camera("ds", {-0.2409573942178872, 0.566996899163044}, 349.8, {752, 480})},
      {"double sphere, small alpha", camera("ds", {0.3, 0.4}, 300)},
  };
}

Eigen::Vector3d ray(double angle, double azimuth) {
  return {std::sin(angle) * std::cos(azimuth), std::sin(angle) * std::sin(azimuth), std::cos(angle)};
}

TEST(Camera, UnprojectThenProjectReturnsThePixelOverTheWholeImage) {
  for (const Named& c : cameras()) {
    const ImageSize size = c.camera->size();
    int missing = 0, all = 0;
    for (double y = 0; y < size.height; y += 7.3) {
      for (double x = 0; x < size.width; x += 7.3, ++all) {
        const auto direction = c.camera->unproject({x, y});
        if (!direction) {
          ++missing;
          continue;
        }
        EXPECT_NEAR(direction->norm(), 1, 1e-14);
        const auto pixel = c.camera->project(2.5 * *direction);
        ASSERT_TRUE(pixel) << c.name << " " << x << " " << y;
        EXPECT_LT((*pixel - Eigen::Vector2d(x, y)).norm(), 2e-9) << c.name;
      }
    }
    if (c.name != "strong tangential") {
      EXPECT_EQ(missing, 0) << c.name << " of " << all;
    }
  }
}

TEST(Camera, ProjectThenUnprojectReturnsTheRayOverTheWholeDomain) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> u(0, 1);
  for (const Named& c : cameras()) {
    // A pinhole's pixels beyond 80 degrees are millions of px away, where 1e-9 px cannot be told apart.
    const bool bounded = c.camera->model() == "pinhole-equidistant";
    const double limit = bounded ? c.camera->valid_angle() : std::min(c.camera->valid_angle(), 80 * kDegree);
    for (int i = 0; i < 2000; ++i) {
      const Eigen::Vector3d direction = ray(0.99 * limit * u(random), 2 * std::numbers::pi * u(random));
      const auto pixel = c.camera->project(std::exp(4 * u(random) - 2) * direction);
      ASSERT_TRUE(pixel) << c.name;
      const auto back = c.camera->unproject(*pixel);
      ASSERT_TRUE(back) << c.name << " " << pixel->transpose();
      EXPECT_LT((*back - direction).norm(), 1e-8) << c.name << " " << direction.transpose();
    }
  }
}

TEST(Camera, JacobianMatchesCentralDifferences) {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> u(0, 1);
  for (const Named& c : cameras()) {
    const double limit = std::min(0.95 * c.camera->valid_angle(), 75 * kDegree);
    for (int i = 0; i < 500; ++i) {
      const double angle = i % 5 == 0 ? 1e-9 * u(random) : limit * u(random);
      const Eigen::Vector3d point = (0.5 + 4 * u(random)) * ray(angle, 6.3 * u(random));
      Matrix23d jacobian;
      ASSERT_TRUE(c.camera->project(point, &jacobian));
      for (int k = 0; k < 3; ++k) {
        const double h = 1e-5;
        const Eigen::Vector3d d = h * Eigen::Vector3d::Unit(k);
        const Eigen::Vector2d column =
            (*c.camera->project(point + d) - *c.camera->project(point - d)) / (2 * h);
        EXPECT_LT((column - jacobian.col(k)).norm(), 1e-6 * (1 + jacobian.norm())) << c.name;
      }
    }
  }
}

TEST(Camera, OnTheAxisTheJacobianIsThatOfThePinhole) {
  for (const Named& c : cameras()) {
    Matrix23d jacobian, beside;
    const auto pixel = c.camera->project({0, 0, 2}, &jacobian);
    ASSERT_TRUE(pixel && c.camera->project({1e-12, -1e-13, 2}, &beside));
    EXPECT_NEAR(std::sqrt(jacobian(0, 0) * jacobian(1, 1)), c.camera->focal_px() / 2, 1e-9) << c.name;
    EXPECT_NEAR(jacobian(0, 1), 0, 1e-12);
    EXPECT_LT(jacobian.col(2).norm(), 1e-12);
    EXPECT_LT((jacobian - beside).norm(), 1e-8) << c.name;
  }
}

TEST(Camera, ModelsAgreeWithoutDistortion) {
  const auto none = camera("none", {});
  const auto radtan = camera("radtan", {0, 0, 0, 0});
  const auto radtan5 = camera("radtan", {0, 0, 0, 0, 0});
  // tan a = a + a^3/3 + 2 a^5/15 + 17 a^7/315 + 62 a^9/2835 + ...
  const auto series = camera("equidistant", {1.0 / 3, 2.0 / 15, 17.0 / 315, 62.0 / 2835});
  for (double angle = 0; angle < 0.2; angle += 0.013) {
    const Eigen::Vector3d point = 3 * ray(angle, 7 * angle);
    const Eigen::Vector2d expected = *none->project(point);
    EXPECT_EQ(*radtan->project(point), expected);
    EXPECT_EQ(*radtan5->project(point), expected);
    EXPECT_LT((*series->project(point) - expected).norm(), 1e-5);
  }
  EXPECT_EQ(none->model(), "pinhole-none");
  EXPECT_EQ(radtan->model(), "pinhole-radtan");
  EXPECT_EQ(series->model(), "pinhole-equidistant");
}

TEST(Camera, RadtanMatchesTheFormulaByHand) {
  const auto c = make_camera({100, 200, 50, 60, "radtan", {-0.1, 0.01, 0.001, 0.002, 0.5}, {101, 121}});
  ASSERT_TRUE(c);
  // m = (0.5, 0.25), r2 = 0.3125: radial = 1 - 0.03125 + 0.0009765625 + 0.5 * 0.030517578125 =
  // 0.9849853515625 x' = 0.49249267578125 + 2*0.001*0.125 + 0.002*(0.3125 + 0.5)  = 0.49436767578125 y' =
  // 0.246246337890625 + 0.001*(0.3125 + 0.125) + 2*0.002*0.125 = 0.247183837890625
  const auto pixel = (*c)->project({1, 0.5, 2});
  ASSERT_TRUE(pixel);
  EXPECT_NEAR(pixel->x(), 100 * 0.49436767578125 + 50, 1e-11);
  EXPECT_NEAR(pixel->y(), 200 * 0.247183837890625 + 60, 1e-11);
  EXPECT_NEAR((*c)->focal_px(), std::sqrt(20000.0), 1e-12);
}

TEST(Camera, EquidistantMatchesTheFormulaByHand) {
  const auto c = make_camera({100, 200, 50, 60, "equidistant", {0.1, -0.02, 0.003, 0.0004}, {101, 121}});
  ASSERT_TRUE(c);
  // (3, 4, 5): angle pi/4, direction (0.6, 0.8).
  const double a = std::numbers::pi / 4;
  const double radius =
      a + 0.1 * std::pow(a, 3) - 0.02 * std::pow(a, 5) + 0.003 * std::pow(a, 7) + 0.0004 * std::pow(a, 9);
  const auto pixel = (*c)->project({3, 4, 5});
  ASSERT_TRUE(pixel);
  EXPECT_NEAR(pixel->x(), 60 * radius + 50, 1e-11);
  EXPECT_NEAR(pixel->y(), 160 * radius + 60, 1e-11);
}

TEST(Camera, DoubleSphereMatchesTheFormulaByHand) {
  const auto c = make_camera({100, 200, 50, 60, "ds", {-0.5, 0.75}, {101, 121}});
  ASSERT_TRUE(c);
  // (3, 4, 12): d1 = 13, xi d1 + z = 5.5, d2 = sqrt(25 + 30.25); the denominator 0.75 d2 + 0.25 * 5.5.
  const double denominator = 0.75 * std::sqrt(55.25) + 0.25 * 5.5;
  const auto pixel = (*c)->project({3, 4, 12});
  ASSERT_TRUE(pixel);
  EXPECT_NEAR(pixel->x(), 300 / denominator + 50, 1e-11);
  EXPECT_NEAR(pixel->y(), 800 / denominator + 60, 1e-11);
  // Without spheres it is the pinhole.
  const auto none = camera("none", {}), ds = camera("ds", {0, 0});
  EXPECT_LT((*ds->project({0.3, -0.2, 1.1}) - *none->project({0.3, -0.2, 1.1})).norm(), 1e-11);
  EXPECT_EQ((*c)->model(), "ds-none");
}

TEST(Camera, DomainEndsAtTheValidAngle) {
  for (const Named& c : cameras()) {
    const double edge = c.camera->valid_angle();
    for (double azimuth = 0.1; azimuth < 6.3; azimuth += 0.37) {
      EXPECT_TRUE(c.camera->project(2 * ray(edge - 1e-6, azimuth))) << c.name;
      if (edge > 3.1) continue;  // beyond pi lies the other side
      EXPECT_FALSE(c.camera->project(2 * ray(edge + 1e-6, azimuth))) << c.name;
    }
  }
}

TEST(Camera, RadtanDomainEndsWhereTheRadiusStopsGrowing) {
  // 1 + 3 k1 r^2 = 0 at r = 1 for k1 = -1/3: 45 degrees.
  EXPECT_NEAR(camera("radtan", {-1.0 / 3, 0, 0, 0})->valid_angle(), 45 * kDegree, 1e-9);
  // With p1 = p alone the Jacobian is least along m = (0, -r): 1 - 6 p r = 0.
  EXPECT_NEAR(camera("radtan", {0, 0, 0.1, 0})->valid_angle(), std::atan(1 / 0.6), 1e-9);
  EXPECT_NEAR(camera("none", {})->valid_angle(), 90 * kDegree, 0.2 * kDegree);
}

TEST(Camera, EquidistantDomainMayReachBehindTheImagePlaneUpToTheFold) {
  EXPECT_NEAR(camera("equidistant", {0, 0, 0, 0})->valid_angle(), std::numbers::pi, 1e-12);
  const auto fold = camera("equidistant", {-1.0 / 12, 0, 0, 0});  // 1 - a^2 / 4 = 0
  EXPECT_NEAR(fold->valid_angle(), 2, 1e-9);
  EXPECT_TRUE(fold->project(ray(1.9, 0.3)));
  EXPECT_FALSE(camera("none", {})->project({0.1, 0.1, -1}));
}

TEST(Camera, PixelsBeyondTheDomainHaveNoRay) {
  const auto radtan = camera("radtan", {-1.0 / 3, 0, 0, 0});  // radius at the fold: 2/3
  EXPECT_TRUE(radtan->unproject({322.4 + 381 * 0.6666, 236.9}));
  EXPECT_FALSE(radtan->unproject({322.4 + 381 * 0.6668, 236.9}));
  const auto fisheye = camera("equidistant", {-1.0 / 12, 0, 0, 0});  // radius at the fold: 4/3
  EXPECT_TRUE(fisheye->unproject({322.4 + 381 * 1.3332, 236.9}));
  EXPECT_FALSE(fisheye->unproject({322.4 + 381 * 1.3334, 236.9}));
}

TEST(Camera, NumbersThatAreNoneGiveNothing) {
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  for (const Named& c : cameras()) {
    EXPECT_FALSE(c.camera->project({nan, 0, 1}));
    EXPECT_FALSE(c.camera->project({0, 0, nan}));
    EXPECT_FALSE(c.camera->project({inf, 1, 1}));
    EXPECT_FALSE(c.camera->project({inf, 1, inf}));
    EXPECT_FALSE(c.camera->project({0, 0, 0}));
    EXPECT_FALSE(c.camera->unproject({nan, 0}));
    EXPECT_FALSE(c.camera->unproject({0, inf}));
  }
}

TEST(Camera, BadIntrinsicsAreRefusedByName) {
  const CameraIntrinsics good{381, 381, 320, 240, "radtan", {0, 0, 0, 0}, {640, 480}};
  const auto where = [&](auto change) {
    CameraIntrinsics c = good;
    change(c);
    const auto made = make_camera(c);
    return made ? std::string("accepted") : made.error().where;
  };
  EXPECT_EQ(where([](auto&) {}), "accepted");
  EXPECT_EQ(where([](auto& c) { c.size.width = 0; }), "resolution");
  EXPECT_EQ(where([](auto& c) { c.fx = -1; }), "intrinsics");
  EXPECT_EQ(where([](auto& c) { c.cy = std::nan(""); }), "intrinsics");
  EXPECT_EQ(where([](auto& c) { c.distortion_model = "fov"; }), "distortion_model");
  EXPECT_EQ(where([](auto& c) { c.distortion = {0, 0}; }), "distortion_coeffs");
  EXPECT_EQ(where([](auto& c) { c.distortion[1] = std::nan(""); }), "distortion_coeffs");
  EXPECT_EQ(where([](auto& c) { c.distortion = {-20, 0, 0, 0}; }), "distortion_coeffs");
  EXPECT_EQ(where([](auto& c) {
              c.distortion_model = "equidistant", c.distortion = {-2, 0, 0, 0};
            }),
            "distortion_coeffs");
  EXPECT_EQ(where([](auto& c) { c.distortion_model = "none"; }), "distortion_coeffs");
  EXPECT_EQ(where([](auto& c) { c.distortion_model = "ds"; }), "distortion_coeffs");
  EXPECT_EQ(where([](auto& c) {
              c.distortion_model = "ds", c.distortion = {0.1, 1.5};
            }),
            "distortion_coeffs");
}

}  // namespace
}  // namespace evpose
