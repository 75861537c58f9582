// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/motion/trajectory_tum.h"

#include "evpose/io/files/atomic_file.h"
#include "evpose/io/files/numbers.h"
#include "evpose/io/motion/trajectory_rows.h"

namespace evpose {

Expected<std::vector<TimedPose>> read_tum(const std::string& path) {
  return read_pose_rows(path, {.row = "a row is `t tx ty tz qx qy qz qw`"});
}

Status write_tum(const std::string& path, const std::vector<TimedPose>& trajectory,
                 const std::string& comment) {
  auto file = AtomicFile::create(path);
  if (!file) return file.error();
  if (!comment.empty()) file->write("# " + comment + "\n");
  Eigen::Quaterniond before = Eigen::Quaterniond::Identity();
  for (const TimedPose& row : trajectory) {
    EVPOSE_CHECK(row.pose.p.allFinite() && row.pose.q.coeffs().allFinite());
    Eigen::Quaterniond q = row.pose.q;
    if (q.dot(before) < 0) q.coeffs() = -q.coeffs();
    before = q;
    std::string line = format_decimal(row.t, 9);
    for (int k = 0; k < 3; ++k) append_number(line, ' ', row.pose.p[k], 9);
    for (int k = 0; k < 4; ++k) append_number(line, ' ', q.coeffs()[k], 10);
    file->write(line + "\n");
  }
  return file->commit();
}

}  // namespace evpose
