// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/motion/trajectory_tum.h"

#include <gtest/gtest.h>

#include "evpose/io/files/test_files.h"

namespace evpose {
namespace {

TEST(Tum, WrittenTrajectoriesReadBack) {
  const TemporaryFolder folder;
  std::vector<TimedPose> trajectory;
  for (int i = 0; i < 50; ++i)
    trajectory.push_back(
        {1'700'000'000'123'456'789 + i, {so3::exp({0.3 * i, -0.2 * i, 0.1}), {0.1 * i, -1e3, 1e-9}}});
  ASSERT_TRUE(write_tum(folder / "a.tum", trajectory, "t x y z qx qy qz qw").ok());
  const auto again = read_tum(folder / "a.tum");
  ASSERT_TRUE(again.ok()) << error_line(again);
  ASSERT_EQ(again->size(), trajectory.size());
  for (std::size_t i = 0; i < trajectory.size(); ++i) {
    EXPECT_EQ((*again)[i].t, trajectory[i].t);
    EXPECT_LT((*again)[i].pose.minus(trajectory[i].pose).norm(), 3e-9);
    EXPECT_GT((*again)[i].pose.q.dot((*again)[i > 0 ? i - 1 : 0].pose.q), 0);
  }
}

TEST(Tum, RowsAreReadAsWritten) {
  const TemporaryFolder folder;
  const auto t =
      read_tum(folder.file("a.tum", "# comment\r\n\n1.5 1 2 3 0 0 0 1.001\r\n  2e0  1 2 3 0 0 0 -1"));
  ASSERT_TRUE(t.ok()) << error_line(t);
  ASSERT_EQ(t->size(), 2u);
  EXPECT_EQ((*t)[0].t, 1'500'000'000);
  EXPECT_EQ((*t)[1].t, 2'000'000'000);
  EXPECT_DOUBLE_EQ((*t)[0].pose.q.w(), 1);
  EXPECT_EQ((*t)[0].pose.p, Eigen::Vector3d(1, 2, 3));
}

TEST(Tum, ErrorsNameTheLine) {
  const TemporaryFolder folder;
  const auto line = [&](const std::string& content) {
    return error_line(read_tum(folder.file("a.tum", content)));
  };
  const std::string good = "1 0 0 0 0 0 0 1\n";
  EXPECT_TRUE(says(line(""), {"a.tum", "no poses"}));
  EXPECT_TRUE(says(line("# only\n"), {"no poses"}));
  EXPECT_TRUE(says(line(good + "2 0 0 0 0 0 1\n"), {"a.tum:2", "7 values instead of 8"}));
  EXPECT_TRUE(says(line(good + "2 0 0 nan 0 0 0 1\n"), {"a.tum:2", "nan"}));
  EXPECT_TRUE(says(line(good + "2 0 0 0 0 0 0 1.1\n"), {"a.tum:2", "norm is 1.1"}));
  EXPECT_TRUE(says(line(good + "2 0 0 0 0 0 0 0\n"), {"a.tum:2", "norm is 0"}));
  EXPECT_TRUE(says(line("# c\n" + good + good), {"a.tum:3", "does not come after"}));
  EXPECT_TRUE(says(line("x 0 0 0 0 0 0 1\n"), {"a.tum:1", "'x'"}));
  EXPECT_TRUE(says(line("1e300 0 0 0 0 0 0 1\n"), {"a.tum:1"}));
}

TEST(Tum, ReleasedTrajectoriesAreRead) {
  const std::string folder = shared_folder() + "/data/real/trajectories";
  EVPOSE_NEEDS_SHARED(folder);
  const std::pair<const char*, std::size_t> counts[] = {{"/vector/corner_slow_est.txt", 3782},
                                                        {"/vector/sofa_normal_est.txt", 8739},
                                                        {"/tum_vie/desk2_est.txt", 2014},
                                                        {"/mvsec/indoor_flying1_est.txt", 2539}};
  for (const auto& [name, count] : counts) {
    const auto trajectory = read_tum(folder + name);
    ASSERT_TRUE(trajectory.ok()) << error_line(trajectory);
    EXPECT_EQ(trajectory->size(), count) << name;
  }
}

}  // namespace
}  // namespace evpose
