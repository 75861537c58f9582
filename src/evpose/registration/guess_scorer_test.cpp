// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/guess_scorer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace evpose {
namespace {

constexpr ImageSize kSize{320, 240};

/// Squares at random depths before the camera, whose edges are both the map and, projected, the events.
class GuessScorerLaws : public ::testing::Test {
 protected:
  GuessScorerLaws() : field_(kSize) {
    std::mt19937 random(5);
    const auto uniform = [&random](double low, double high) {
      return low + (high - low) * static_cast<double>(random()) / 4294967296.0;
    };
    std::vector<FilteredEvent> events;
    for (int square = 0; square < 30; ++square) {
      const Eigen::Vector3d corner(uniform(-1.6, 1.4), uniform(-1.2, 1), uniform(2, 4));
      for (int side = 0; side < 4; ++side) {
        const Eigen::Vector3d along = side < 2 ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitY();
        const Eigen::Vector3d across = side < 2 ? Eigen::Vector3d::UnitY() : Eigen::Vector3d::UnitX();
        for (double s = 0; s < 0.4; s += 0.005)
          points_.push_back({corner + s * along + 0.4 * (side & 1) * across, along});
      }
    }
    for (const SearchPoint& p : points_) {
      const auto u = camera_->project(p.position);
      if (!u || !kSize.contains(*u)) continue;
      FilteredEvent e{};
      e.x = static_cast<std::uint16_t>(std::lround(u->x()));
      e.y = static_cast<std::uint16_t>(std::lround(u->y()) & 0x7FFF);
      events.push_back(e);
    }
    field_.build(events);
  }
  GuessScorer scorer() const {
    return {{field_, *camera_, T_body_cam_, points_}, Eigen::Vector3d::Zero(), 1};
  }

  EdgeField field_;
  std::shared_ptr<const Camera> camera_ =
      std::move(make_camera({250, 250, 159.5, 119.5, "none", {}, kSize})).value();
  Pose T_body_cam_{so3::exp({0.3, -0.2, 0.5}), {0.1, 0, -0.05}};
  Pose truth_ = T_body_cam_.inverse();  ///< the camera stands at the map's origin
  std::vector<SearchPoint> points_;
};

TEST_F(GuessScorerLaws, APoseThatIsTurnedIsTurnedBack) {
  const Eigen::Vector3d turn_cam(5 / 250.0, -4 / 250.0, 0);
  const Pose off = Pose{so3::exp(turn_cam), Eigen::Vector3d::Zero()} * truth_;
  const PoseGuess found = scorer().turned(off);
  EXPECT_LT(found.T_map_body.q.angularDistance(truth_.q), 2 / 250.0);
  EXPECT_NEAR(found.score, scorer().turned(truth_).score, 0.1);
}

TEST_F(GuessScorerLaws, StepsLeadBackToThePoseAndNeverToAWorseOne) {
  GuessScorer scorer = this->scorer();
  const double best = scorer.turned(truth_).score;
  for (const Eigen::Vector3d& off : {Eigen::Vector3d(0.08, 0, 0), Eigen::Vector3d(0, -0.06, 0.1)}) {
    PoseGuess guess{{truth_.q, truth_.p + off}};
    const double before = scorer.turned(guess.T_map_body).score;
    EXPECT_LT(before, best - 0.2);
    scorer.improve(guess, 10);
    EXPECT_GE(guess.score, before);
    EXPECT_LT((guess.T_map_body.p - truth_.p).norm(), 0.5 * off.norm()) << off.transpose();
  }
}

TEST_F(GuessScorerLaws, TheSameSeedMakesTheSameSteps) {
  PoseGuess a{{truth_.q, truth_.p + Eigen::Vector3d(0.05, 0.02, 0)}}, b = a;
  scorer().improve(a, 8);
  scorer().improve(b, 8);
  EXPECT_EQ(a.T_map_body.p, b.T_map_body.p);
  EXPECT_EQ(a.score, b.score);
}

TEST(StandardNormal, HasUnitVarianceAndNoMean) {
  std::mt19937 random(2);
  Vector6d sum = Vector6d::Zero(), squares = Vector6d::Zero();
  constexpr int kDraws = 20000;
  for (int i = 0; i < kDraws; ++i) {
    const Vector6d x = standard_normal(random);
    sum += x;
    squares += x.cwiseAbs2();
  }
  EXPECT_LT((sum / kDraws).cwiseAbs().maxCoeff(), 0.03);
  EXPECT_LT((squares / kDraws - Vector6d::Ones()).cwiseAbs().maxCoeff(), 0.04);
}

}  // namespace
}  // namespace evpose
