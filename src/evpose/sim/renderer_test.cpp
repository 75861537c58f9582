// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/renderer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "evpose/core/parallel.h"
#include "evpose/sim/scene_contours.h"
#include "evpose/sim/test_scene.h"
#include "evpose/sim/trajectory.h"

namespace evpose::sim {
namespace {

std::shared_ptr<const Camera> test_camera(ImageSize size) {
  const double focal = 0.6 * size.width;
  return make_camera(
             {focal, focal, 0.5 * size.width, 0.5 * size.height, "radtan", {-0.1, 0.02, 5e-4, -3e-4}, size})
      .value();
}

// Looks along +x of the body.
Pose camera_axes() {
  Eigen::Matrix3d axes;
  axes << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  return {Eigen::Quaterniond(axes), Eigen::Vector3d::Zero()};
}

TEST(Renderer, APixelIsTheMeanOverItsArea) {
  const Scene scene =
      test_scene({{{1.5, 0.1, 0}, {0.8, 0.8, 0.8}, 33, 0.9}, {{0.9, -0.4, -0.3}, {0.1, 0.2, 0.9}, -10, 0.5}});
  const auto camera = test_camera({96, 72});
  const Renderer renderer(scene, *camera);
  ThreadPool pool(1);
  const Pose T_map_cam = Pose{so3::exp({0.2, 0.1, 0.05}), {-0.5, 0.1, 0.2}} * camera_axes();
  Frame frame;
  renderer.render(T_map_cam, pool, frame);
  constexpr int kFine = 12;
  double worst = 0, sum = 0;
  for (int y = 0; y < 72; ++y) {
    for (int x = 0; x < 96; ++x) {
      double mean = 0;
      for (int i = 0; i < kFine * kFine; ++i) {
        const int column = i % kFine, row = i / kFine;
        const Eigen::Vector2d pixel(x - 0.5 + (column + 0.5) / kFine, y - 0.5 + (row + 0.5) / kFine);
        const SceneHit hit = *scene.trace(T_map_cam.p, T_map_cam.q * *camera->unproject(pixel));
        mean += scene.boxes[hit.face / 6].faces[0].mean(0, 0, 0, 0) / (kFine * kFine);
      }
      const double error = std::abs(mean - frame.radiance[y * 96 + x]);
      worst = std::max(worst, error);
      sum += error;
    }
  }
  EXPECT_LT(worst, 0.09);  // one or two of 16 samples at a step of 0.7
  EXPECT_LT(sum / (96 * 72), 5e-4);
}

TEST(Renderer, AnEdgePassesAPixelSmoothly) {
  const Scene scene = test_scene({{{2, 1, 0}, {0.5, 2, 2}, 0, 0.9}});  // its side at y = 0
  const auto camera = test_camera({96, 72});
  const Renderer renderer(scene, *camera);
  ThreadPool pool(1);
  Frame frame;
  const double metres_per_px = 1.75 / (0.6 * 96);
  double before = -1;
  for (double shift_px = -1.5; shift_px <= 1.5; shift_px += 1.0 / 32) {
    renderer.render(Pose{{1, 0, 0, 0}, {0, shift_px * metres_per_px, 0}} * camera_axes(), pool, frame);
    const double now = frame.radiance[36 * 96 + 48];
    if (before >= 0) {
      EXPECT_GE(now, before - 1e-6);
      EXPECT_LT(now - before, 0.7 * 2.5 / 16);
    }
    before = now;
  }
  EXPECT_NEAR(before, 0.9, 0.01);
}

TEST(Renderer, TheSameForAnyThreads) {
  const Scene scene = make_box_room(1);
  const auto camera = test_camera({120, 90});
  const Renderer renderer(scene, *camera);
  ThreadPool one(1), three(3);
  Frame a, b;
  const Pose T_map_cam = make_square_spiral(1).at(0.4).T_map_body * camera_axes();
  renderer.render(T_map_cam, one, a);
  renderer.render(T_map_cam, three, b);
  EXPECT_EQ(a.radiance, b.radiance);
  EXPECT_EQ(a.face, b.face);
}

class RoomView : public ::testing::Test {
 protected:
  static constexpr int kWidth = 480, kHeight = 360;

  struct Projected {
    Eigen::Vector2d pixel;
    bool visible;
  };
  std::vector<Projected> project(const Pose& T_map_cam) const {
    std::vector<Projected> all;
    for (std::size_t i = 0; i < map_.points.size(); ++i) {
      const Eigen::Vector3d point = map_.position(i);
      const auto pixel = camera_->project(T_map_cam.inverse() * point);
      if (!pixel || !camera_->size().contains(*pixel, 2)) continue;
      const SceneHit hit = *scene_.trace(T_map_cam.p, point - T_map_cam.p);
      all.push_back({*pixel, hit.distance > 1 - 2e-3});
    }
    return all;
  }
  int face(double x, double y) const {
    return frame_
        .face[static_cast<std::size_t>(std::lround(y)) * kWidth + static_cast<std::size_t>(std::lround(x))];
  }

  Scene scene_ = make_box_room(1);
  ContourMap map_ = make_contours(scene_, 0.01);
  std::shared_ptr<const Camera> camera_ = test_camera({kWidth, kHeight});
  Renderer renderer_{scene_, *camera_};
  ThreadPool pool_{2};
  Frame frame_;
};

TEST_F(RoomView, VisibleContourPointsLieWhereFacesMeetAndAllSuchPlacesHaveOne) {
  for (const double t : {0.0, 1.3, 2.6}) {
    const Pose T_map_cam = make_square_spiral(1).at(t).T_map_body * camera_axes();
    renderer_.render(T_map_cam, pool_, frame_);
    int visible = 0, on_border = 0;
    std::vector<char> near(static_cast<std::size_t>(kWidth) * kHeight, 0);
    for (const Projected& p : project(T_map_cam)) {
      if (!p.visible) continue;
      ++visible;
      const int middle = face(p.pixel.x(), p.pixel.y());
      bool border = false;
      for (int dy = -1; dy <= 1; ++dy) {
        for (int dx = -1; dx <= 1; ++dx)
          border = border || face(p.pixel.x() + dx, p.pixel.y() + dy) != middle;
      }
      on_border += border;
      for (int y = -2; y <= 2; ++y) {
        for (int x = -2; x <= 2; ++x)
          near[static_cast<std::size_t>(std::lround(p.pixel.y()) + y) * kWidth + std::lround(p.pixel.x()) +
               x] = 1;
      }
    }
    EXPECT_GT(visible, 2000);
    EXPECT_GT(on_border, 0.995 * visible);
    int borders = 0, mapped = 0;
    for (int y = 4; y < kHeight - 4; ++y) {
      for (int x = 4; x < kWidth - 4; ++x) {
        if (face(x, y) == face(x + 1, y) && face(x, y) == face(x, y + 1)) continue;
        ++borders;
        mapped += near[static_cast<std::size_t>(y) * kWidth + x];
      }
    }
    EXPECT_GT(borders, 2000);
    EXPECT_GT(mapped, 0.98 * borders);
  }
}

TEST_F(RoomView, ImageSpeedBoundsTheMotionOfTheContours) {
  const Trajectory trajectory = make_square_spiral(1);
  for (const double t : {0.2, 1.1, 2.3}) {
    const Motion motion = trajectory.at(t);
    const Pose T_map_cam = motion.T_map_body * camera_axes();
    renderer_.render(T_map_cam, pool_, frame_);
    const Eigen::Quaterniond to_cam = camera_axes().q.conjugate();
    const double speed = renderer_.image_speed(
        frame_, to_cam * (motion.T_map_body.q.conjugate() * motion.velocity), to_cam * motion.rate);
    const double step_s = 0.48 / speed;
    const Pose T_next = trajectory.at(t + step_s).T_map_body * camera_axes();
    double most = 0;
    for (std::size_t i = 0; i < map_.points.size(); ++i) {
      const Eigen::Vector3d point = map_.position(i);
      const auto now = camera_->project(T_map_cam.inverse() * point),
                 next = camera_->project(T_next.inverse() * point);
      if (!now || !next || !camera_->size().contains(*now)) continue;
      if (scene_.trace(T_map_cam.p, point - T_map_cam.p)->distance < 1 - 2e-3) continue;
      most = std::max(most, (*next - *now).norm());
    }
    EXPECT_LT(most, 0.52);
    EXPECT_GT(most, 0.3);
  }
}

}  // namespace
}  // namespace evpose::sim
