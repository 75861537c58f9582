// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/trajectory_csv.h"

#include <gtest/gtest.h>

#include "evpose/io/atomic_file.h"
#include "evpose/io/test_files.h"
#include "evpose/io/waypoints.h"

namespace evpose {
namespace {

TEST(TrajectoryCsv, RowsOfEurocAreRead) {
  const TemporaryFolder folder;
  const auto t =
      read_trajectory_csv(folder.file("a.csv",
                                      "#timestamp, p_RS_R_x [m], ...\r\n"
                                      "1403636580838555648,4.5,-1.7,0.78,0.6,0,0,0.8,-0.01,0.03,1\r\n"
                                      "1403636580843555648,1,2,3,-1.0005,0,0,0\n"));
  ASSERT_TRUE(t.ok()) << error_line(t);
  ASSERT_EQ(t->size(), 2u);
  EXPECT_EQ((*t)[0].t, 1403636580838555648);
  EXPECT_EQ((*t)[0].pose.p, Eigen::Vector3d(4.5, -1.7, 0.78));
  EXPECT_DOUBLE_EQ((*t)[0].pose.q.w(), 0.6);
  EXPECT_DOUBLE_EQ((*t)[0].pose.q.z(), 0.8);
  EXPECT_DOUBLE_EQ((*t)[1].pose.q.w(), -1);
}

TEST(TrajectoryCsv, ErrorsNameTheLine) {
  const TemporaryFolder folder;
  const auto line = [&](const std::string& content) {
    return error_line(read_trajectory_csv(folder.file("a.csv", content)));
  };
  const std::string good = "5,0,0,0,1,0,0,0\n";
  EXPECT_TRUE(says(line("#\n"), {"a.csv", "no poses"}));
  EXPECT_TRUE(says(line(good + "6,0,0,0,1,0,0\n"), {"a.csv:2", "7 values"}));
  EXPECT_TRUE(says(line(good + "6,0,inf,0,1,0,0,0\n"), {"a.csv:2", "inf"}));
  EXPECT_TRUE(says(line(good + "1.5,0,0,0,1,0,0,0\n"), {"a.csv:2", "nanoseconds"}));
  EXPECT_TRUE(says(line(good + "6,0,0,0,1,1,0,0\n"), {"a.csv:2", "norm"}));
  EXPECT_TRUE(says(line(good + good), {"a.csv:2", "does not come after"}));
  EXPECT_TRUE(says(error_line(read_trajectory_csv(folder / "none.csv")), {"none.csv"}));
}

TEST(Waypoints, RowsAreReadAndErrorsNameTheLine) {
  const TemporaryFolder folder;
  const auto points = read_waypoints(folder.file("a.txt", "# x y z yaw\n1 2 3 90\n4, 5, 6, -90, 1.5\n"));
  ASSERT_TRUE(points.ok()) << error_line(points);
  ASSERT_EQ(points->size(), 2u);
  EXPECT_EQ((*points)[0].position, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ((*points)[0].pause_s, 0);
  EXPECT_EQ((*points)[1].yaw_deg, -90);
  EXPECT_EQ((*points)[1].pause_s, 1.5);
  const auto line = [&](const std::string& content) {
    return error_line(read_waypoints(folder.file("a.txt", content)));
  };
  EXPECT_TRUE(says(line("1 2 3 0\n"), {"a.txt", "1 waypoints"}));
  EXPECT_TRUE(says(line("1 2 3\n"), {"a.txt:1", "3 values"}));
  EXPECT_TRUE(says(line("1 2 3 0\n1 2 3 nan\n"), {"a.txt:2", "nan"}));
  EXPECT_TRUE(says(line("1 2 3 0\n1 2 1e300 0\n"), {"a.txt:2", "1e300"}));
  EXPECT_TRUE(says(line("1 2 3 0 -1\n"), {"a.txt:1", "pause"}));
}

}  // namespace
}  // namespace evpose
