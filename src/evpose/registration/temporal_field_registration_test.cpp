// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/temporal_field_registration.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <random>

#include "evpose/registration/test_temporal_field_ceres.h"

namespace evpose {
namespace {

constexpr std::uint32_t kNow = 1'000'000;

/// The contours of a box seen by a camera, and the surface that their motion leaves behind.
class TemporalFieldLaws : public ::testing::Test {
 protected:
  TemporalFieldLaws() {
    camera_ = std::move(make_camera({300, 300, 160, 120, "none", {}, {320, 240}})).value();
    T_body_cam_ = {so3::exp({0.1, -0.2, 0.05}), {0.05, 0.02, -0.01}};
    truth_ = Pose{so3::exp({0.2, 0.1, -0.3}), {0.5, -0.2, 0.3}};
    // Slanted lines at many depths: the rounding of events to pixels averages out along each.
    for (double s = -1; s <= 1; s += 0.01)
      for (double a : {-0.75, -0.45, 0.1, 0.4, 0.8}) {
        add_line_point({s, a + 0.3 * s, 2.5 + 1.2 * a}, {1, 0.3, 0}, a < 0.2 ? Polarity::on : Polarity::off);
        add_line_point({a - 0.4 * s, s, 3 - 1.5 * a}, {-0.4, 1, 0}, a < 0.2 ? Polarity::off : Polarity::on);
      }
    draw_events();
  }

  void add_line_point(const Eigen::Vector3d& x_cam, const Eigen::Vector3d& tangent_cam, Polarity polarity) {
    const Pose T_map_cam = truth_ * T_body_cam_;
    Matrix23d J;
    const auto pixel = camera_->project(x_cam, &J);
    if (!pixel || !camera_->size().contains(*pixel, 6)) return;
    const Eigen::Vector2d along = J * tangent_cam;
    points_.push_back({T_map_cam * x_cam, 5000, FieldPolarity::both});
    normals_.push_back(Eigen::Vector2d(-along.y(), along.x()).normalized());
    cam_.push_back(x_cam);
    polarities_.push_back(polarity);
  }

  /// Each contour is a ridge: events now on it, ever older to both sides.
  void draw_events() {
    for (int ring = 3; ring >= 0; --ring)
      for (std::size_t i = 0; i < points_.size(); ++i) {
        const Eigen::Vector2d u = *camera_->project(cam_[i]);
        for (double side : {-1.0, 1.0}) {
          const Eigen::Vector2d at = u + side * ring * normals_[i];
          const int x = static_cast<int>(std::lround(at.x())), y = static_cast<int>(std::lround(at.y()));
          if (x < 0 || y < 0 || x >= 320 || y >= 240) continue;
          surface_.insert(x, y, polarities_[i], kNow - static_cast<std::uint32_t>(1500 * ring));
        }
      }
  }

  FieldProblem problem(const Pose& predicted, const Matrix6d& prior) const {
    return {surface_, *camera_, T_body_cam_, points_, kNow, predicted, prior};
  }

  static Pose off(const Pose& pose) {
    Vector6d d;
    d << 0.008, -0.006, 0.01, -0.002, 0.003, 0.002;
    return pose.plus(d);
  }

  std::shared_ptr<const Camera> camera_;
  Pose T_body_cam_, truth_;
  std::vector<FieldPoint> points_;
  std::vector<Eigen::Vector3d> cam_;
  std::vector<Polarity> polarities_;      ///< of the events of each point
  std::vector<Eigen::Vector2d> normals_;  ///< across the projected lines
  TimeSurface surface_{320, 240};
  static TemporalFieldConfig confident() {
    TemporalFieldConfig config;
    config.correlated_points = 1;
    config.robust_scale = 2;
    config.max_iterations = 60;
    config.converged_px = 1e-6;
    return config;
  }
  Matrix6d loose_ = 1e-2 * Matrix6d::Identity();
};

TEST_F(TemporalFieldLaws, JacobianMatchesDifferencesForEveryPolarity) {
  const Pose at = off(truth_);
  const FieldProblem p = problem(at, loose_);
  int compared = 0;
  for (FieldPoint point : points_) {
    point.polarity = static_cast<FieldPolarity>(compared % 3);
    double r = 0;
    Vector6d J;
    if (!evaluate_point(p, FieldKernel::spline, at, point, &r, &J)) continue;
    for (int k = 0; k < 6; ++k) {
      const double h = 1e-6;
      double ahead = 0, behind = 0;
      const Vector6d d = h * Vector6d::Unit(k);
      evaluate_point(p, FieldKernel::spline, at.plus(d), point, &ahead, nullptr);
      evaluate_point(p, FieldKernel::spline, at.plus(-d), point, &behind, nullptr);
      EXPECT_NEAR(J(k), (ahead - behind) / (2 * h), 1e-3 * (1 + std::abs(J(k))));
    }
    ++compared;
  }
  EXPECT_GT(compared, 400);
}

TEST_F(TemporalFieldLaws, FindsThePoseTheEventsWereDrawnFrom) {
  ThreadPool pool(1);
  const FieldSolution r = minimise(problem(off(truth_), loose_), confident(), pool);
  // Events sit on whole pixels, so the poses may differ where the points' images hardly do.
  const auto mean_offset_px = [&](const Pose& pose) {
    double sum = 0;
    for (std::size_t i = 0; i < points_.size(); ++i)
      sum += std::abs(
          normals_[i].dot(*camera_->project((pose * T_body_cam_).inverse() * points_[i].position_map) -
                          *camera_->project(cam_[i])));
    return sum / static_cast<double>(points_.size());
  };
  EXPECT_GT(mean_offset_px(off(truth_)), 0.8);
  EXPECT_LT(mean_offset_px(r.T_map_body), 0.15);
  EXPECT_GT(r.matched, 0.9 * r.seen);
}

TEST_F(TemporalFieldLaws, BothSolversFindTheSameMinimum) {
  ThreadPool pool(1);
  const Pose predicted = off(truth_);
  for (bool predicted_polarity : {false, true}) {
    for (std::size_t i = 0; predicted_polarity && i < points_.size(); ++i)
      points_[i].polarity = polarities_[i] == Polarity::on ? FieldPolarity::on : FieldPolarity::off;
    const FieldProblem p = problem(predicted, loose_);
    const FieldSolution ours = minimise(p, confident(), pool),
                        reference = minimise_with_ceres(p, confident());
    const Vector6d d = ours.T_map_body.minus(reference.T_map_body);
    EXPECT_LT(d.head<3>().norm(), 1e-4);
    EXPECT_LT(d.tail<3>().norm(), 3e-5);
    EXPECT_LE(ours.cost, reference.cost * 1.0005);
  }
}

TEST_F(TemporalFieldLaws, AnyNumberOfThreadsGivesTheSameBits) {
  ThreadPool one(1), three(3);
  const Pose predicted = off(truth_);
  const FieldProblem p = problem(predicted, loose_);
  const FieldSolution a = minimise(p, {}, one), b = minimise(p, {}, three);
  EXPECT_EQ(a.T_map_body.p, b.T_map_body.p);
  EXPECT_EQ(a.T_map_body.q.coeffs(), b.T_map_body.q.coeffs());
  EXPECT_EQ(a.information, b.information);
}

TEST_F(TemporalFieldLaws, AStrongPriorHoldsThePredictionAndNoEventsChangeNothing) {
  ThreadPool pool(1);
  const Pose predicted = off(truth_);
  const FieldSolution held = minimise(problem(predicted, 1e14 * Matrix6d::Identity()), {}, pool);
  EXPECT_LT(held.T_map_body.minus(predicted).norm(), 1e-8);
  const TimeSurface empty(320, 240);
  const FieldProblem p{empty, *camera_, T_body_cam_, points_, kNow, predicted, loose_};
  const FieldSolution blind = minimise(p, {}, pool);
  EXPECT_EQ(blind.matched, 0);
  EXPECT_EQ(blind.information, Matrix6d::Zero());
  EXPECT_LT(blind.T_map_body.minus(predicted).norm(), 1e-12);
}

TEST_F(TemporalFieldLaws, InformationAndVectorPointFromThePredictionToTheMinimum) {
  ThreadPool pool(1);
  const Pose predicted = off(truth_);
  const FieldSolution r = minimise(problem(predicted, loose_), confident(), pool);
  // At the joint minimum the gradient vanishes: information d - vector + prior d = 0.
  const Vector6d d = r.T_map_body.minus(predicted);
  const Vector6d gradient = r.information * d - r.vector + loose_ * d;
  EXPECT_LT((Matrix6d(r.information + loose_).inverse() * gradient).norm(), 2e-4);
}

TEST(TemporalField, DecayAtOneTimeConstantIsOneOverE) {
  TimeSurface surface(20, 20);
  for (int y = 0; y < 20; ++y)
    for (int x = 0; x < 20; ++x) surface.insert(x, y, Polarity::on, 4000);
  for (FieldKernel kernel : {FieldKernel::bilinear, FieldKernel::spline}) {
    const FieldSample s = sample_field(surface, {8.3, 9.7}, 9000, 5000, kernel);
    EXPECT_NEAR(s.value, std::exp(-1), 1e-6);
    EXPECT_LT(s.gradient.norm(), 1e-6);
  }
}

TEST(TemporalField, PolaritiesAreSeparateAndOfBothTheNewerWins) {
  TimeSurface surface(20, 20);
  surface.insert(5, 5, Polarity::on, 1000);
  surface.insert(5, 5, Polarity::off, 2000);
  const auto value = [&](FieldPolarity polarity) {
    return sample_field(surface, {5, 5}, 3000, 1000, FieldKernel::bilinear, polarity).value;
  };
  EXPECT_NEAR(value(FieldPolarity::on), std::exp(-2), 1e-6);
  EXPECT_NEAR(value(FieldPolarity::off), std::exp(-1), 1e-6);
  EXPECT_NEAR(value(FieldPolarity::both), std::exp(-1), 1e-6);
}

TEST(TemporalField, GradientMatchesDifferences) {
  std::mt19937 random(2);
  TimeSurface surface(30, 30);
  for (int i = 0; i < 400; ++i)
    surface.insert(static_cast<int>(random() % 30), static_cast<int>(random() % 30), Polarity::on,
                   static_cast<std::uint32_t>(random() % 10000 + 1));
  for (FieldKernel kernel : {FieldKernel::bilinear, FieldKernel::spline})
    for (const Eigen::Vector2d& u :
         {Eigen::Vector2d(10.3, 12.6), Eigen::Vector2d(3.5, 25.2), Eigen::Vector2d(0.4, 28.7)}) {
      const auto value = [&](double dx, double dy) {
        return sample_field(surface, u + Eigen::Vector2d(dx, dy), 10000, 4000, kernel).value;
      };
      const double h = 1e-4;
      const FieldSample s = sample_field(surface, u, 10000, 4000, kernel);
      EXPECT_NEAR(s.gradient.x(), (value(h, 0) - value(-h, 0)) / (2 * h), 1e-6);
      EXPECT_NEAR(s.gradient.y(), (value(0, h) - value(0, -h)) / (2 * h), 1e-6);
    }
}

TEST(TemporalField, SplineIsContinuousAcrossPixelCentres) {
  TimeSurface surface(20, 20);
  surface.insert(9, 9, Polarity::on, 5000);
  surface.insert(10, 9, Polarity::on, 3000);
  const FieldSample a = sample_field(surface, {9 - 1e-9, 9.2}, 6000, 2000, FieldKernel::spline);
  const FieldSample b = sample_field(surface, {9 + 1e-9, 9.2}, 6000, 2000, FieldKernel::spline);
  EXPECT_NEAR(a.value, b.value, 1e-7);
  EXPECT_LT((a.gradient - b.gradient).norm(), 1e-7);
}

}  // namespace
}  // namespace evpose
