// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map/visible_set.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <set>

namespace evpose {
namespace {

ContourMap random_map(std::size_t n, double half_extent_m) {
  std::mt19937 random(11);
  std::uniform_real_distribution<float> u(-1, 1);
  ContourMap map;
  map.anchor = {100, -50, 3};
  for (std::size_t i = 0; i < n; ++i) {
    ContourPoint p;
    p.position = Eigen::Vector3f(u(random), u(random), u(random)) * static_cast<float>(half_extent_m);
    p.tangent = Eigen::Vector3f(u(random), u(random), u(random)).normalized();
    map.points.push_back(p);
  }
  return map;
}

constexpr double kScale = 0.5;  // of lengths given for an image 640 wide, which has 320

class VisibleLaws : public ::testing::Test {
 protected:
  VisibleLaws() : map_(random_map(20000, 8)), index_(map_) {
    camera_ =
        std::move(make_camera({300, 300, 159.5, 119.5, "radtan", {-0.1, 0.02, 0, 0}, {320, 240}})).value();
    pose_ = {so3::exp({0.3, -0.5, 0.2}), map_.anchor + Eigen::Vector3d(1, 0.5, -2)};
  }
  /// By looking at every point.
  bool in_frustum(std::uint32_t i, const VisibleSetConfig& c) const {
    const Eigen::Vector3d x = pose_.inverse() * map_.position(i);
    const auto pixel = camera_->project(x);
    return pixel && x.z() >= c.near_m && x.norm() <= c.far_m &&
           camera_->size().contains(*pixel, -kScale * c.margin_px) &&
           (pose_.q.conjugate() * map_.points[i].tangent.cast<double>()).cross(x.normalized()).norm() >=
               c.grazing_sin;
  }
  ContourMap map_;
  ContourIndex index_;
  std::shared_ptr<const Camera> camera_;
  Pose pose_;
};

TEST_F(VisibleLaws, IndexFindsWhatBruteForceFinds) {
  for (double radius : {0.3, 2.0, 100.0}) {
    std::vector<std::uint32_t> cubes;
    index_.append_cubes_within(pose_.p, radius, cubes);
    std::set<std::uint32_t> found;
    for (const std::uint32_t c : cubes)
      for (std::uint32_t k = index_.cubes()[c].begin; k < index_.cubes()[c].end; ++k)
        found.insert(index_.order()[k]);
    for (std::uint32_t i = 0; i < map_.points.size(); ++i)
      if ((map_.position(i) - pose_.p).norm() < radius - 1e-4) {
        EXPECT_TRUE(found.count(i)) << i;
      }
    EXPECT_TRUE(std::is_sorted(cubes.begin(), cubes.end()));
  }
}

TEST_F(VisibleLaws, ViewDependentContoursAreInNoCube) {
  ContourMap marked = map_;
  std::set<std::uint32_t> others;
  for (std::uint32_t i = 0; i < marked.points.size(); ++i) {
    if (i % 3 != 2) marked.points[i].kind = i % 3 == 0 ? ContourKind::cylinder_axis : ContourKind::shadow;
    if (i % 3 == 2) others.insert(i);
  }
  const ContourIndex index(marked);
  EXPECT_EQ(std::set<std::uint32_t>(index.order().begin(), index.order().end()), others);
  for (ContourPoint& p : marked.points) p.kind = ContourKind::shadow;
  EXPECT_TRUE(ContourIndex(marked).cubes().empty());
}

TEST_F(VisibleLaws, ChosenOrBesideAChosenPointIsExactlyTheFrustum) {
  VisibleSetConfig config;
  config.far_m = 6;
  VisibleSet visible(index_, *camera_, config);
  const auto& chosen = visible.choose(pose_);
  EXPECT_GT(chosen.size(), 200u);
  const auto pixel = [&](std::uint32_t i) { return *camera_->project(pose_.inverse() * map_.position(i)); };
  for (const std::uint32_t i : chosen) EXPECT_TRUE(in_frustum(i, config));
  const std::set<std::uint32_t> set(chosen.begin(), chosen.end());
  for (std::uint32_t i = 0; i < map_.points.size(); ++i)
    if (in_frustum(i, config) && !set.count(i)) {
      EXPECT_TRUE(std::any_of(chosen.begin(), chosen.end(), [&](std::uint32_t k) {
        return (pixel(k) - pixel(i)).norm() < config.stride_px + 1e-3;
      })) << i;
    }
}

TEST_F(VisibleLaws, SlicesAndThreadsChooseWhatOneCallChooses) {
  VisibleSetConfig config;
  VisibleSet sliced(index_, *camera_, config), threaded(index_, *camera_, config, true);
  sliced.choose(pose_);
  threaded.choose(pose_);
  Vector6d step = Vector6d::Zero();
  step(5) = 0.02 * kScale * config.refresh_px / camera_->focal_px();
  const auto before = sliced.chosen();
  Pose at = pose_;
  int same = 0;
  std::vector<Pose> path{pose_};
  for (int i = 0; i < 49; ++i) {
    path.push_back(at = at.plus(step));
    EXPECT_EQ(sliced.choose(at), threaded.choose(at)) << i;
    if (sliced.chosen() == before) ++same;
  }
  EXPECT_GT(same, 30);  // no earlier than needed
  EXPECT_LT(same, 49);
  // What is served is the choice for the pose half-way from where it was begun to where it is taken.
  const auto taken = static_cast<std::size_t>(same + 1);
  bool is_half_way = false;
  for (std::size_t updates = 6; updates < taken; ++updates) {
    const Pose& begun = path[taken - updates];
    const Vector6d step_then = begun.minus(path[taken - updates - 1]);
    const Pose half_way = begun.plus(0.5 * static_cast<double>(updates) * step_then);
    is_half_way |= sliced.chosen() == VisibleSet(index_, *camera_, config).choose(half_way);
  }
  EXPECT_TRUE(is_half_way);
}

TEST_F(VisibleLaws, AChoiceIsNeverOlderThanItsBound) {
  VisibleSetConfig config;
  VisibleSet sliced(index_, *camera_, config);
  Pose at = pose_;
  sliced.choose(at);
  Vector6d step = Vector6d::Zero();
  step(5) = 0.3 * kScale * config.refresh_px / camera_->focal_px();
  auto last = sliced.chosen();
  int unchanged = 0;
  for (int i = 0; i < 40; ++i) {
    at = at.plus(step);
    const auto now = sliced.choose(at);
    unchanged = now == last ? unchanged + 1 : 0;
    EXPECT_LE(unchanged, 3) << i;
    last = now;
  }
}

TEST_F(VisibleLaws, PointsOfALineKeepTheirDistanceAndCoverIt) {
  ContourMap line;
  for (int i = 0; i < 2000; ++i) {
    ContourPoint p;
    p.position = {-1 + 0.001F * static_cast<float>(i), 0.2F, 3};
    p.tangent = {1, 0, 0};
    line.points.push_back(p);
    p.position.y() = 0.23F;  // a second line, 3 px from the first
    line.points.push_back(p);
  }
  const ContourIndex index(line);
  VisibleSetConfig config;
  config.stride_px = 6;
  VisibleSet visible(index, *camera_, config);
  std::vector<double> along;
  for (const std::uint32_t i : visible.choose(Pose{}))
    if (i % 2 == 0) along.push_back(camera_->project(line.position(i))->x());
  std::sort(along.begin(), along.end());
  ASSERT_GT(along.size(), 20u);
  for (std::size_t k = 1; k < along.size(); ++k) {
    EXPECT_GE(along[k] - along[k - 1], 5.99);
    EXPECT_LE(along[k] - along[k - 1], 12.0);
  }
  EXPECT_NEAR(static_cast<double>(visible.chosen().size()), 2.0 * static_cast<double>(along.size()), 6);
}

TEST_F(VisibleLaws, BudgetHolds) {
  VisibleSetConfig config;
  config.budget = 50;
  VisibleSet small(index_, *camera_, config);
  EXPECT_EQ(small.choose(pose_).size(), 50u);
}

TEST_F(VisibleLaws, ChoiceStaysUntilTheViewHasMoved) {
  VisibleSet visible(index_, *camera_, {});
  const auto first = visible.choose(pose_);
  Vector6d step = Vector6d::Zero();
  step(5) = 0.005;  // 1.5 px
  EXPECT_EQ(visible.choose(pose_.plus(step)), first);
  step(5) = 0.2;
  EXPECT_NE(visible.choose(pose_.plus(step)), first);
}

TEST_F(VisibleLaws, ChoiceDoesNotDependOnThePast) {
  VisibleSet fresh(index_, *camera_, {}), travelled(index_, *camera_, {});
  Pose other = pose_;
  other.p.x() += 3;
  travelled.choose(other);
  EXPECT_EQ(fresh.choose(pose_), travelled.choose(pose_));
}

TEST_F(VisibleLaws, NothingBehindTheCamera) {
  ContourMap behind;
  behind.points.resize(1);
  behind.points[0].position = {0, 0, -1};
  behind.points[0].tangent = {1, 0, 0};
  const ContourIndex index(behind);
  VisibleSet visible(index, *camera_, {});
  EXPECT_TRUE(visible.choose(Pose{}).empty());
}

}  // namespace
}  // namespace evpose
