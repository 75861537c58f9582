// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/relocalization/pose_aliases.h"

#include <gtest/gtest.h>

#include <cmath>

#include "evpose/relocalization/test_room.h"

namespace evpose {
namespace {

constexpr double kPeriodY_m = 1.9, kPeriodZ_m = 2.6;

/// A wall of windows all alike, and of one door.
std::vector<test_room::Segment> facade() {
  std::vector<test_room::Segment> edges;
  for (int i = -4; i <= 4; ++i)
    for (int k = 0; k < 4; ++k) {
      const Eigen::Vector3d low(7, i * kPeriodY_m, 1 + k * kPeriodZ_m);
      test_room::add_box(low, low + Eigen::Vector3d(0.1, 0.9, 1.3), edges);
    }
  test_room::add_box({7, -0.85, 0}, {7.1, -0.15, 2.5}, edges);
  return edges;
}

class PoseAliasLaws : public ::testing::Test {
 protected:
  /// Seen from the true pose.
  void see(const std::vector<test_room::Segment>& edges) {
    map_ = test_room::map_of(edges);
    points_.clear();
    for (std::size_t i = 0; i < map_.points.size(); i += 4)
      points_.push_back({map_.position(i), map_.points[i].tangent.cast<double>()});
    std::vector<FilteredEvent> events;
    const Pose T_cam_map = (truth_ * T_body_cam_).inverse();
    for (std::size_t i = 0; i < map_.points.size(); ++i) {
      const Eigen::Vector3d x = T_cam_map * map_.position(i);
      const auto pixel = x.z() > 0.2 ? camera_->project(x) : std::nullopt;
      if (!pixel || !camera_->size().contains(*pixel, 2)) continue;
      FilteredEvent e{};
      e.x = static_cast<std::uint16_t>(std::lround(pixel->x()));
      e.y = static_cast<std::uint16_t>(std::lround(pixel->y()) & 0x7FFF);
      events.push_back(e);
    }
    field_.build(events);
  }
  SearchView view() const { return {field_, *camera_, T_body_cam_, points_}; }
  std::vector<PoseGuess> aliases_of(const Pose& T) const {
    return find_aliases(T, main_directions(map_), [this](const Pose&) { return view(); });
  }

  std::shared_ptr<const Camera> camera_ = test_room::make_room_camera();
  Pose T_body_cam_ = test_room::camera_on_body();
  Pose truth_{so3::exp(Eigen::Vector3d(0.02, -0.05, 0.1)), {0.3, 0.2, 3.1}};
  ContourMap map_;
  std::vector<SearchPoint> points_;
  EdgeField field_{camera_->size()};
};

TEST_F(PoseAliasLaws, FromOnePeriodOnTheTruePoseIsTheBest) {
  see(facade());
  for (const Eigen::Vector3d& off :
       {Eigen::Vector3d(0.03, kPeriodY_m, 0.02), Eigen::Vector3d(0, -kPeriodY_m, 0),
        Eigen::Vector3d(-0.02, 0.01, kPeriodZ_m)}) {
    const std::vector<PoseGuess> found = aliases_of({truth_.q, truth_.p + off});
    ASSERT_FALSE(found.empty());
    EXPECT_LT((found.front().T_map_body.p - truth_.p).norm(), 0.02) << off.transpose();
    EXPECT_LT(found.front().T_map_body.q.angularDistance(truth_.q), 0.003);
  }
}

TEST_F(PoseAliasLaws, TheTruePoseHasThosePeriodsOnAndEachScoresLess) {
  see(facade());
  const double own = score_pose(view(), truth_, EdgeSpread::fine);
  int periods_on = 0;
  for (const PoseGuess& alias : aliases_of(truth_)) {
    EXPECT_LT(alias.score, own);
    const Eigen::Vector3d off = alias.T_map_body.p - truth_.p;
    EXPECT_GT(off.norm(), 0.05);
    const Eigen::Vector2d periods(off.y() / kPeriodY_m, off.z() / kPeriodZ_m);
    periods_on += (periods - periods.array().round().matrix()).norm() < 0.03;
  }
  EXPECT_GE(periods_on, 3);
}

TEST_F(PoseAliasLaws, ARoomWithoutRepetitionHasNoneAsGoodByFar) {
  see(test_room::room());
  const double own = score_pose(view(), truth_, EdgeSpread::fine);
  const std::vector<PoseGuess> found = aliases_of(truth_);
  EXPECT_FALSE(found.empty());
  for (const PoseGuess& alias : found) EXPECT_LT(alias.score, 0.5 * own);
}

TEST_F(PoseAliasLaws, NothingInViewHasNone) {
  see(facade());
  points_.clear();
  EXPECT_TRUE(aliases_of(truth_).empty());
}

}  // namespace
}  // namespace evpose
