// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/pose_search.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "evpose/registration/coarse_ranking.h"
#include "evpose/registration/guess_scorer.h"

namespace evpose {
namespace {

constexpr ImageSize kSize{320, 240};

FilteredEvent event_at(double x, double y) {
  FilteredEvent e{};
  e.x = static_cast<std::uint16_t>(std::lround(x));
  e.y = static_cast<std::uint16_t>(std::lround(y) & 0x7FFF);
  return e;
}

TEST(EdgeField, DistanceIsThatOfTheLineAndGrowsAcrossIt) {
  EdgeField field(kSize);
  std::vector<FilteredEvent> events;
  for (int y = 20; y < 220; ++y) events.push_back(event_at(150, y));
  field.build(events);
  const int upright = EdgeField::direction(0, 1);
  for (double x : {120.0, 140.5, 150.0, 163.25}) {
    const EdgeField::Sample s = field.sample(x, 120, upright);
    EXPECT_NEAR(s.distance, std::abs(x - 150), 1e-4);
    EXPECT_NEAR(s.dy, 0, 1e-4);
    if (std::abs(x - 150) > 1) {
      EXPECT_NEAR(s.dx, x < 150 ? -1 : 1, 1e-4) << x;
    }
  }
}

TEST(EdgeField, LinesOfAnotherDirectionAreNotSeen) {
  EdgeField field(kSize);
  std::vector<FilteredEvent> events;
  for (int y = 20; y < 220; ++y) events.push_back(event_at(150, y));
  field.build(events);
  EXPECT_EQ(field.sample(150, 120, EdgeField::direction(1, 0)).distance, EdgeField::kReach_px);
}

TEST(EdgeField, DirectionOfALineHasNoSign) {
  for (double a = 0; a < 6.3; a += 0.1) {
    const double x = std::cos(a), y = std::sin(a);
    EXPECT_EQ(EdgeField::direction(x, y), EdgeField::direction(-x, -y)) << a;
  }
}

TEST(EdgeField, LikelihoodRatioIsAboveOneOnALoneEdgeAndOneInTexture) {
  EdgeField field(kSize);
  std::vector<FilteredEvent> events;
  for (int y = 10; y < 230; ++y) {
    events.push_back(event_at(60, y));
    for (int x = 200; x < 310; x += 8) events.push_back(event_at(x, y));
  }
  field.build(events);
  const int upright = EdgeField::direction(0, 1);
  EXPECT_GT(field.likelihood_ratio(60, 120, upright, EdgeSpread::fine), 10);
  double mean = 0;
  for (int x = 240; x < 272; ++x) mean += field.likelihood_ratio(x, 120, upright, EdgeSpread::fine) / 32;
  EXPECT_NEAR(mean, 1, 0.1);
}

/// A cloud of boxes in front of the camera, whose edges are both the map and, projected, the events.
class PoseSearchLaws : public ::testing::Test {
 protected:
  PoseSearchLaws() : field_(kSize) {
    camera_ = std::move(make_camera({250, 250, 159.5, 119.5, "none", {}, kSize})).value();
    std::mt19937 random(3);
    const auto uniform = [&](double low, double high) {
      return low + (high - low) * static_cast<double>(random()) / 4294967296.0;
    };
    for (int box = 0; box < 12; ++box) {
      const Eigen::Vector3d corner(uniform(-1.6, 1.4), uniform(-1.2, 1), uniform(2, 4));
      for (int axis = 0; axis < 3; ++axis)
        for (int k = 0; k < 4; ++k) {
          Eigen::Vector3d from = corner, along = Eigen::Vector3d::Zero();
          from[(axis + 1) % 3] += 0.5 * (k & 1);
          from[(axis + 2) % 3] += 0.5 * (k >> 1);
          along[axis] = 1;
          for (double s = 0; s < 0.5; s += 0.005) lines_.push_back({from + s * along, along});
        }
    }
    for (std::size_t i = 0; i < lines_.size(); i += 6) points_.push_back(lines_[i]);
    field_.build(events(Pose{}));
  }
  std::vector<FilteredEvent> events(const Pose& T_map_cam) const {
    std::vector<FilteredEvent> out;
    for (const SearchPoint& p : lines_) {
      const auto u = camera_->project(T_map_cam.inverse() * p.position);
      if (u && kSize.contains(*u)) out.push_back(event_at(u->x(), u->y()));
    }
    return out;
  }
  SearchView view() const { return {field_, *camera_, T_body_cam_, points_}; }
  /// How far the nearest attitude is off.
  static double nearest_rad(const std::vector<PoseGuess>& guesses) {
    double out = 4;
    for (const PoseGuess& g : guesses) out = std::min(out, so3::log(g.T_map_body.q).norm());
    return out;
  }

  EdgeField field_;
  std::shared_ptr<const Camera> camera_;
  Pose T_body_cam_;
  std::vector<SearchPoint> lines_, points_;
};

TEST_F(PoseSearchLaws, TheTruePoseScoresBest) {
  const double best = score_pose(view(), Pose{}, EdgeSpread::fine);
  for (int axis = 0; axis < 6; ++axis) {
    Vector6d d = Vector6d::Zero();
    d(axis) = 0.04;
    EXPECT_GT(best, score_pose(view(), Pose{}.plus(d), EdgeSpread::fine) + 0.03) << axis;
  }
}

TEST_F(PoseSearchLaws, TheTableOfScoresSaysWhatTheFieldDoesOfTheBestTurn) {
  CoarseScores table(field_, *camera_, 0.3F, -0.3F);
  table.set_points(points_, Eigen::Vector3d::Zero());
  for (int axis = 0; axis < 6; ++axis)
    for (const double off : {0.0, 0.01, -0.02, 0.2}) {
      Vector6d d = Vector6d::Zero();
      d(axis) = off;
      const Pose T_map_cam = Pose{}.plus(d), T_cam_map = T_map_cam.inverse();
      const auto best = table.best_turn(T_cam_map.rotation().cast<float>(), T_cam_map.p.cast<float>());
      const Pose turned{T_map_cam.q * so3::exp(best.turn), T_map_cam.p};
      EXPECT_NEAR(best.score, score_pose(view(), turned, EdgeSpread::fine), 0.1) << axis << ' ' << off;
    }
}

/// Points are projected eight at a time, added two at a time, and some hundreds in 16 bits.
TEST_F(PoseSearchLaws, TheTableSaysTheSameOfPointsThatAreGivenManyTimes) {
  CoarseScores table(field_, *camera_, 0.3F, -0.3F);
  for (const std::size_t count : {1UL, 2UL, 7UL, 9UL, 50UL}) {
    const std::vector<SearchPoint> few(points_.begin(), points_.begin() + static_cast<std::ptrdiff_t>(count));
    table.set_points(few, Eigen::Vector3d::Zero());
    const auto once = table.best_turn(Eigen::Matrix3f::Identity(), Eigen::Vector3f::Zero());
    std::vector<SearchPoint> many;
    for (const std::size_t wanted : {3 * count, 1000UL, 1501UL}) {
      while (many.size() < wanted) many.insert(many.end(), few.begin(), few.end());
      table.set_points(many, Eigen::Vector3d::Zero());
      const auto again = table.best_turn(Eigen::Matrix3f::Identity(), Eigen::Vector3f::Zero());
      EXPECT_EQ(again.turn, once.turn) << count << ' ' << wanted;
      EXPECT_NEAR(again.score, once.score, 1e-6) << count << ' ' << wanted;
    }
  }
}

TEST_F(PoseSearchLaws, ATurnWithinReachIsTurnedBack) {
  CoarseScores table(field_, *camera_, 0.3F, -0.3F);
  table.set_points(points_, Eigen::Vector3d::Zero());
  const double px = 1 / camera_->focal_px();
  for (const Eigen::Vector2d& off_px :
       {Eigen::Vector2d(5, 0), Eigen::Vector2d(-3, 6), Eigen::Vector2d(4, -5)}) {
    const Eigen::Vector3d off(off_px.x() * px, off_px.y() * px, 0);
    const Pose T_cam_map = Pose{so3::exp(off), Eigen::Vector3d::Zero()}.inverse();
    const auto best = table.best_turn(T_cam_map.rotation().cast<float>(), T_cam_map.p.cast<float>());
    EXPECT_LT((best.turn + off).norm(), 1.5 * px) << off_px.transpose();
  }
}

TEST_F(PoseSearchLaws, RefiningReturnsToTheTruePose) {
  Vector6d d;
  d << 0.02, -0.03, 0.02, 0.01, 0.01, -0.015;
  const PoseGuess refined = refine_pose(view(), Pose{}.plus(d), Matrix6d::Identity(), 12);
  EXPECT_LT(refined.T_map_body.p.norm(), 0.006);
  EXPECT_LT(so3::log(refined.T_map_body.q).norm(), 0.003);
}

TEST_F(PoseSearchLaws, ThePoseIsFoundFromAWidePrior) {
  Vector6d d, sigma;
  d << 0.1, -0.1, 0.08, 0.03, -0.04, 0.02;
  sigma << 0.1, 0.1, 0.1, 0.04, 0.04, 0.04;
  const Matrix6d covariance = sigma.cwiseAbs2().asDiagonal();
  const auto found = search_pose(view(), {Pose{}.plus(d), covariance}, 1);
  ASSERT_FALSE(found.empty());
  EXPECT_LT(found[0].T_map_body.p.norm(), 0.01);
  EXPECT_LT(so3::log(found[0].T_map_body.q).norm(), 0.005);
  for (const PoseGuess& g : found) EXPECT_LE(g.score, found[0].score);
}

TEST_F(PoseSearchLaws, AttitudesThatAreToldAreLookedAtWhateverThePriorSays) {
  Vector6d d, sigma;
  d << 0.1, -0.1, 0.08, 0, 0, 2;
  sigma << 0.1, 0.1, 0.1, 0.3, 0.3, 0.3;
  const PosePrior prior{Pose{}.plus(d), sigma.cwiseAbs2().asDiagonal()};
  PosePrior told = prior;
  told.attitudes = {so3::exp({0.8, 0, 0}), so3::exp({0.01, -0.01, 0.005})};
  told.attitude_sigma_rad = 0.015;
  EXPECT_GT(nearest_rad(search_pose(view(), prior, 1)), 0.3);
  EXPECT_LT(nearest_rad(search_pose(view(), told, 1)), 0.1);
}

TEST_F(PoseSearchLaws, AScorerTurnsAPoseBack) {
  const GuessScorer scorer(view(), Eigen::Vector3d::Zero(), 1);
  const double px = 1 / camera_->focal_px();
  const PoseGuess found = scorer.turned({so3::exp({5 * px, -4 * px, 0}), Eigen::Vector3d::Zero()});
  EXPECT_LT(so3::log(found.T_map_body.q).norm(), 2 * px);
  EXPECT_NEAR(found.score, scorer.turned(Pose{}).score, 0.1);
}

TEST_F(PoseSearchLaws, RandomStepsNeverLeadToAWorsePoseAndMostlyToABetterOne) {
  GuessScorer scorer(view(), Eigen::Vector3d::Zero(), 1);
  std::mt19937 random(7);
  int better = 0;
  constexpr int kStarts = 20;
  for (int i = 0; i < kStarts; ++i) {
    PoseGuess guess{Pose{}.plus(0.05 * standard_normal(random))};
    const double before = scorer.turned(guess.T_map_body).score;
    scorer.improve(guess, 10);
    EXPECT_GE(guess.score, before);
    better += guess.score > before + 0.05 ? 1 : 0;
  }
  EXPECT_GT(better, kStarts / 2);
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

TEST_F(PoseSearchLaws, TheSameSeedGivesTheSamePoses) {
  const Matrix6d covariance = 1e-4 * Matrix6d::Identity();
  const auto a = search_pose(view(), {Pose{}, covariance}, 5),
             b = search_pose(view(), {Pose{}, covariance}, 5);
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) EXPECT_EQ(a[i].T_map_body.p, b[i].T_map_body.p);
}

}  // namespace
}  // namespace evpose
