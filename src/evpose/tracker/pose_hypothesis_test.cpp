// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/pose_hypothesis.h"

#include <gtest/gtest.h>

namespace evpose {
namespace {

TEST(PoseHypotheses, ThoseThatHaveComeTogetherAreOneThatTheirSearchesHaveFound) {
  std::vector<PoseHypothesis> all(4);
  all[1].nav.T_map_body.p.x() = 1e-3;  // of the same search
  all[2].nav.T_map_body.p.x() = 2e-3, all[2].newest_search = 2;
  all[3].nav.T_map_body.p.x() = 0.1, all[3].newest_search = 2;
  merge_duplicates(all);
  ASSERT_EQ(all.size(), 2U);
  EXPECT_EQ(all[0].found, 2);
  EXPECT_EQ(all[0].newest_search, 2);
  EXPECT_EQ(all[0].nav.T_map_body.p.x(), 0);
  EXPECT_EQ(all[1].found, 1);
}

TEST(PoseHypotheses, CarriedOnAndBackAgainAPoseIsWhereItWas) {
  const Pose T{so3::exp(Eigen::Vector3d(0.3, -0.2, 1)), {1, 2, 3}};
  const Eigen::Vector3d velocity(1, -2, 0.5), rate(0.4, 3, -1);
  const Pose on = carried_on(T, velocity, rate, 0.1);
  EXPECT_LT((on.p - T.p - 0.1 * velocity).norm(), 1e-15);
  EXPECT_NEAR(on.q.angularDistance(T.q), 0.1 * rate.norm(), 1e-12);
  EXPECT_LT(carried_on(on, velocity, rate, -0.1).minus(T).norm(), 1e-12);
}

}  // namespace
}  // namespace evpose
