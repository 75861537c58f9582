// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/motion/trajectory_rows.h"

#include <array>
#include <cmath>

#include "evpose/io/files/numbers.h"
#include "evpose/io/files/row_reader.h"

namespace evpose {
namespace {

constexpr std::size_t kPoseColumns = 8;

Expected<TimedPose> parse_row(const RowReader& rows, const PoseRowLayout& layout) {
  const auto& fields = rows.fields();
  if (fields.size() < kPoseColumns || fields.size() > layout.most_columns)
    return Error{rows.where(), text(fields.size(), " values instead of ", kPoseColumns), layout.row};
  TimedPose row;
  if (!parse_decimal(fields[0], layout.time_decimals, row.t) || row.t > kLargestTimeNs ||
      row.t < -kLargestTimeNs)
    return Error{rows.where(), text("'", fields[0], "' is not a time in ", layout.unit), layout.row};
  std::array<double, 7> v{};
  if (auto status = rows.numbers(1, v, layout.row); !status) return status.error();
  row.pose.p = {v[0], v[1], v[2]};
  row.pose.q = layout.w_first ? Eigen::Quaterniond(v[3], v[4], v[5], v[6])
                              : Eigen::Quaterniond(v[6], v[3], v[4], v[5]);
  const double norm = row.pose.q.norm();
  if (!(std::abs(norm - 1) <= 1e-2))
    return Error{rows.where(), text("the quaternion's norm is ", norm, ", not 1"), layout.row};
  row.pose.q.normalize();
  return row;
}

}  // namespace

Error not_after(const std::string& where, TimeNs t, TimeNs last) {
  return Error{
      where,
      text("the stamp ", format_decimal(t, 9), " s does not come after ", format_decimal(last, 9), " s"),
      "sort the file by time and remove repeated stamps"};
}

Expected<std::vector<TimedPose>> read_pose_rows(const std::string& path, const PoseRowLayout& layout) {
  auto rows = RowReader::open(path);
  if (!rows) return rows.error();
  std::vector<TimedPose> trajectory;
  while (true) {
    const auto more = rows->next();
    if (!more) return more.error();
    if (!*more) break;
    const auto row = parse_row(*rows, layout);
    if (!row) return row.error();
    if (!trajectory.empty() && row->t <= trajectory.back().t)
      return not_after(rows->where(), row->t, trajectory.back().t);
    trajectory.push_back(*row);
  }
  if (trajectory.empty()) return Error{path, "no poses", layout.row};
  return trajectory;
}

}  // namespace evpose
