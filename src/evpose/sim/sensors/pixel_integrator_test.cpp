// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/sensors/pixel_integrator.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <numbers>

#include "evpose/core/parallel.h"
#include "evpose/sim/light/panes.h"
#include "evpose/sim/light/test_scene.h"

namespace evpose::sim {
namespace {

constexpr double kFocal = 200;

EventCameraConfig ideal_pixels() {
  EventCameraConfig config;
  config.threshold_sigma = config.refractory_us = config.bandwidth_hz_per_cd_m2 = 0;
  config.dark_cd_m2 = 1e-9;
  config.leak_hz = config.shot_noise_dark_hz = config.shot_noise_bright_hz = config.hot_pixel_fraction = 0;
  config.reference_spread = 0;
  return config;
}

// Integrates a scene seen from a camera that moves uniformly without rotation.
struct Shot {
  Shot(const Scene& of, const Eigen::Vector3d& from, const Eigen::Vector3d& by)
      : scene(of), start(from), velocity(by) {
    integrator.veiling_glare = 0;
  }

  Scene scene;
  Eigen::Vector3d start, velocity;
  std::shared_ptr<const Camera> camera = test_camera(64, 48, kFocal);
  EventCameraConfig pixels = ideal_pixels();
  PixelIntegratorConfig integrator;
  double duration_s = 0.05;
  int threads = 1;
  std::vector<Exposure*> exposures;

  std::vector<SimEvent> shoot() const {
    ThreadPool pool(threads);
    const PreparedScene prepared(scene, pool);
    const auto rays = pixel_rays(*camera);
    EventPixels event_pixels(camera->size(), pixels, 1);
    const auto path = [&](double t_s) {
      const Pose pose = looking_along_x(start + t_s * velocity);
      return CameraMotion{pose, pose.q.conjugate() * velocity, Eigen::Vector3d::Zero()};
    };
    PixelIntegrator one(prepared, *camera, *rays, path, integrator, event_pixels, pool);
    one.start(0);
    std::vector<SimEvent> events;
    const TimeNs end = from_seconds(duration_s);
    for (TimeNs t = 0; t < end;) t = one.advance(end, exposures, events);
    return events;
  }
};

// Events of one polarity by pixel, in order.
using ByPixel = std::map<std::pair<int, int>, std::vector<SimEvent>>;
ByPixel by_pixel(const std::vector<SimEvent>& events) {
  ByPixel out;
  for (const SimEvent& e : events) out[{e.x, e.y}].push_back(e);
  return out;
}

// An upright edge at y = 0, 2 m ahead, passes the camera at 0.9 m/s: 90 px/s. Every pixel that it crosses
// whole must fire floor(ln(contrast) / threshold) times, when the area of the new side reaches it.
void expect_theory(const Scene& scene, double left, double right, double tolerance_s = 20e-6) {
  Shot shot(scene, {0, -0.015, 0}, {0, 0.9, 0});
  const ByPixel events = by_pixel(shot.shoot());
  const double px_per_s = kFocal * 0.9 / 2;
  const int wanted = static_cast<int>(std::floor(std::abs(std::log(left / right)) / 0.25));
  int pixels = 0;
  for (int x = 0; x < 64; ++x) {
    // The edge is at column cx + f (y_cam - 0) / 2: it moves to the right while the camera goes left.
    const double start_px = 31.5 + kFocal * -0.015 / 2;
    const double enters = (x - 0.5 - start_px) / px_per_s;
    const bool whole = enters > 0 && enters + 1 / px_per_s < shot.duration_s;
    for (int y = 0; y < 48; ++y) {
      const auto at = events.find({x, y});
      if (!whole) continue;
      ASSERT_NE(at, events.end()) << x << " " << y;
      ASSERT_EQ(at->second.size(), wanted) << x << " " << y;
      ++pixels;
      for (int k = 0; k < wanted; ++k) {
        // The left side takes the place of the right.
        const double sign = left > right ? 1 : -1;
        const double fraction = (right * std::exp(sign * 0.25 * (k + 1)) - right) / (left - right);
        EXPECT_EQ(at->second[k].on, left > right);
        EXPECT_NEAR(to_seconds(at->second[k].t), enters + fraction / px_per_s, tolerance_s)
            << x << " " << y << " " << k;
      }
    }
  }
  EXPECT_GT(pixels, 100);
}

TEST(PixelIntegrator, PrintedStepEdgeFiresWhenTheorySays) {
  TestScene plain;
  plain.add({2, 0, -1}, {0, 0, 2}, {0, 1, 0}, 0.6);
  plain.add({2, -1, -1}, {0, 0, 2}, {0, 1, 0}, 0.1);
  expect_theory(plain.scene, 0.6, 0.1);
}

TEST(PixelIntegrator, OutlineBeforeAFarWallFiresWhenTheorySays) {
  TestScene plain;
  plain.add({2, 0, -1}, {0, 0, 2}, {0, 1, 0}, 0.08);
  plain.add({4, -1, -1}, {0, 0, 2}, {0, 2, 0}, 0.5);
  expect_theory(plain.scene, 0.08, 0.5);
}

// A pane that mirrors nothing takes the same fraction of both sides.
TEST(PixelIntegrator, StepEdgeThroughAPaneFiresAsWithout) {
  TestScene plain;
  plain.add({2, 0, -1}, {0, 0, 2}, {0, 1, 0}, 0.6);
  plain.add({2, -1, -1}, {0, 0, 2}, {0, 1, 0}, 0.1);
  plain.scene.panes = {{{1, -2, -2}, {0, 4, 0}, {0, 0, 4}}};
  expect_theory(plain.scene, 0.6, 0.1);
}

// A pane 0.75 m ahead mirrors an edge 0.5 m behind the camera, which seems to be 2 m ahead. Four points of a
// pixel are mirrored: half a pixel of motion is the bound of the error.
TEST(PixelIntegrator, MirroredStepEdgeFiresWhenTheorySays) {
  constexpr double kBehindPane = 0.02, kLeft = 0.9, kRight = 0.05, kHalfPixel_s = 0.5 / 90;
  TestScene plain;
  plain.add({2, -2, -2}, {0, 0, 4}, {0, 4, 0}, kBehindPane);
  plain.add({-0.5, 0, -2}, {0, 2, 0}, {0, 0, 4}, kLeft);
  plain.add({-0.5, -2, -2}, {0, 2, 0}, {0, 0, 4}, kRight);
  plain.scene.panes = {{{0.75, -2, -2}, {0, 4, 0}, {0, 0, 4}}};
  const PlateLight light = plate_light(1, kGlassIndex);
  expect_theory(plain.scene, light.through * kBehindPane + light.mirrored * kLeft,
                light.through * kBehindPane + light.mirrored * kRight, kHalfPixel_s);
}

// Across a slanted edge the area grows with the square of the way at first and at last: every event comes
// within a fiftieth of a pixel of where the area reaches its threshold.
TEST(PixelIntegrator, SlantedEdgeFiresWhenTheorySays) {
  for (const double lean : {0.1, 0.4, 0.9}) {
    TestScene plain;
    plain.add({2, -lean, -1}, {0, 2 * lean, 2}, {0, 3, 0}, 0.6);
    plain.add({2, -lean - 3, -1}, {0, 2 * lean, 2}, {0, 3, 0}, 0.1);
    Shot shot(plain.scene, {0, -0.015, 0}, {0, 0.9, 0});
    const double px_per_s = kFocal * 0.9 / 2;
    int count = 0;
    double sum = 0;
    for (const auto& [pixel, events] : by_pixel(shot.shoot())) {
      // Columns by which the edge has passed the centre of the pixel, and the area that it has then covered.
      const auto passed = [&, at = pixel](double t_s) {
        return 31.5 + kFocal * -0.015 / 2 + px_per_s * t_s + lean * (at.second - 23.5) - at.first;
      };
      const auto luminance = [&](double way) {
        return 0.1 + 0.5 * fraction_above(static_cast<float>(way), {1, static_cast<float>(lean)});
      };
      const double half = 0.5 * (1 + lean);
      if (passed(0) > -half || passed(shot.duration_s) < half) continue;
      ASSERT_EQ(events.size(), 7U);  // ln(6) / 0.25 = 7.2
      for (int k = 0; k < 7; ++k) {
        double low = -half, high = half;
        for (int i = 0; i < 40; ++i) {
          const double middle = 0.5 * (low + high);
          (luminance(middle) < 0.1 * std::exp(0.25 * (k + 1)) ? low : high) = middle;
        }
        const double error_px = std::abs(passed(to_seconds(events[k].t)) - low);
        EXPECT_LT(error_px, 0.15) << lean << " " << k;
        sum += error_px;
        ++count;
      }
    }
    EXPECT_GT(count, 100);
    EXPECT_LT(sum / count, 0.01) << lean;
  }
}

// Both edges of a dark bar of 1.3 pixels give as many events as go back again.
TEST(PixelIntegrator, ThinBarComesAndGoes) {
  TestScene plain;
  plain.add({2, 0, -1}, {0, 0, 2}, {0, 0.013, 0}, 0.1);
  plain.add({4, -1, -1}, {0, 0, 2}, {0, 2, 0}, 0.5);
  Shot shot(plain.scene, {0, -0.02, 0}, {0, 0.9, 0});
  shot.duration_s = 0.1;
  int pixels = 0;
  for (const auto& [pixel, events] : by_pixel(shot.shoot())) {
    const double start_px = 31.5 + kFocal * -0.02 / 2, end_px = start_px + 9 - 1.3;
    if (pixel.first - 0.5 < start_px || pixel.first + 0.5 > end_px - 1) continue;
    ++pixels;
    // ln(5) / 0.25 = 6.4: six down, and up again; the full dark lasts for less than a step and may go unseen.
    ASSERT_GE(events.size(), 10U) << pixel.first;
    EXPECT_FALSE(events.front().on);
    EXPECT_TRUE(events.back().on);
  }
  EXPECT_GT(pixels, 100);
}

TEST(PixelIntegrator, NothingMovesNothingFires) {
  TestScene plain;
  plain.add({2, 0, -1}, {0, 0, 2}, {0, 1, 0}, 0.6);
  plain.add({4, -1, -1}, {0, 0, 2}, {0, 2, 0}, 0.5);
  const Shot shot(plain.scene, {0, 0, 0}, {0, 0, 0});
  EXPECT_TRUE(shot.shoot().empty());
}

TEST(PixelIntegrator, ThreadsDoNotMatter) {
  TestScene plain;
  plain.add({2, 0, -1}, {0, 0, 2}, {0, 1, 0}, 0.6);
  plain.add({4, -1, -1}, {0, 0, 2}, {0, 2, 0}, 0.2);
  plain.scene.objects.push_back("fan");
  MovingPart part{"fan", {}, [](double t_s) { return Pose{so3::exp({20 * t_s, 0, 0}), {1.5, -0.1, 0}}; }};
  TestScene::add_to(part.mesh, {0, -0.02, -0.1}, {0, 0.04, 0}, {0, 0, 0.2}, plain.material(0.05));
  plain.scene.moving.push_back(part);
  Shot shot(plain.scene, {0, -0.02, 0}, {0.3, 0.9, 0.1});
  shot.pixels = {};
  const auto one = shot.shoot();
  shot.threads = 3;
  const auto three = shot.shoot();
  ASSERT_EQ(one.size(), three.size());
  EXPECT_GT(one.size(), 1000U);
  for (std::size_t i = 0; i < one.size(); ++i) {
    ASSERT_EQ(one[i].t, three[i].t);
    ASSERT_EQ(one[i].x, three[i].x);
    ASSERT_EQ(one[i].on, three[i].on);
  }
}

// A frame is the mean of luminance over its exposure: where an edge passes, the fraction of time that each
// side was seen.
TEST(PixelIntegrator, FrameIsTheMeanOfItsExposure) {
  TestScene plain;
  plain.add({2, 0, -1}, {0, 0, 2}, {0, 1, 0}, 0.6);
  plain.add({2, -1, -1}, {0, 0, 2}, {0, 1, 0}, 0.1);
  Exposure exposure{from_seconds(0.01), from_seconds(0.04), std::vector<float>(64 * 48)};
  Shot shot(plain.scene, {0, -0.015, 0}, {0, 0.9, 0});
  shot.exposures = {&exposure};
  (void)shot.shoot();
  const double px_per_s = kFocal * 0.9 / 2, start_px = 31.5 + kFocal * -0.015 / 2;
  for (int x = 0; x < 64; ++x) {
    double wanted = 0;  // by many small steps
    for (int i = 0; i < 3000; ++i) {
      const double edge = start_px + px_per_s * (0.01 + 1e-5 * (i + 0.5));
      wanted += (0.1 + 0.5 * std::clamp(edge - (x - 0.5), 0.0, 1.0)) / 3000;
    }
    EXPECT_NEAR(exposure.sum[20 * 64 + x] / 0.03, wanted, 2e-3) << x;
  }
}

TEST(PixelIntegrator, LightsOffIsSeenByAll) {
  TestScene plain;
  plain.add({2, -1, -1}, {0, 0, 2}, {0, 2, 0}, 0.5);
  plain.scene.lights[0].switching.off_at_s = 0.0203;
  plain.scene.lights[0].switching.off_factor = 0.1;
  Shot shot(plain.scene, {0, 0, 0}, {0, 0, 0});
  const auto events = by_pixel(shot.shoot());
  ASSERT_EQ(events.size(), 64U * 48);
  for (const auto& [pixel, list] : events) {
    ASSERT_EQ(list.size(), 9U);  // ln(10) / 0.25 = 9.2
    for (int k = 0; k < 9; ++k) {
      EXPECT_FALSE(list[k].on);
      // The fade is linear in 2 ms.
      const double factor = std::exp(-0.25 * (k + 1));
      EXPECT_NEAR(to_seconds(list[k].t), 0.0203 + 2e-3 * (1 - factor) / 0.9, 5e-6);
    }
  }
}

}  // namespace
}  // namespace evpose::sim
