// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/motion/trajectory_rows.h"

#include <array>
#include <charconv>
#include <cmath>

#include "evpose/io/files/input_file.h"
#include "evpose/io/files/numbers.h"

namespace evpose {
namespace {

constexpr std::size_t kPoseColumns = 8;

Expected<TimedPose> parse_row(const std::vector<std::string_view>& fields, const PoseRowLayout& layout,
                              const std::string& where) {
  if (fields.size() < kPoseColumns || fields.size() > layout.most_columns)
    return Error{where, text(fields.size(), " values instead of ", kPoseColumns), layout.row};
  TimedPose row;
  if (!parse_decimal(fields[0], layout.time_decimals, row.t) || row.t > kLargestTimeNs ||
      row.t < -kLargestTimeNs)
    return Error{where, text("'", fields[0], "' is not a time in ", layout.unit), layout.row};
  std::array<double, 7> v{};
  for (std::size_t k = 0; k < 7; ++k) {
    if (!parse_number(fields[k + 1], v[k]) || !std::isfinite(v[k]))
      return Error{where, text("'", fields[k + 1], "' is not a finite number"), layout.row};
  }
  row.pose.p = {v[0], v[1], v[2]};
  row.pose.q = layout.w_first ? Eigen::Quaterniond(v[3], v[4], v[5], v[6])
                              : Eigen::Quaterniond(v[6], v[3], v[4], v[5]);
  const double norm = row.pose.q.norm();
  if (!(std::abs(norm - 1) <= 1e-2))
    return Error{where, text("the quaternion's norm is ", norm, ", not 1"), layout.row};
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
  auto lines = LineReader::open(path);
  if (!lines) return lines.error();
  std::vector<TimedPose> trajectory;
  std::vector<std::string_view> fields;
  std::string_view line;
  while (true) {
    const auto more = lines->next(line);
    if (!more) return more.error();
    if (!*more) break;
    line = trimmed(line);
    if (line.empty() || line.front() == '#') continue;
    split_fields(line, fields);
    const auto row = parse_row(fields, layout, lines->where());
    if (!row) return row.error();
    if (!trajectory.empty() && row->t <= trajectory.back().t)
      return not_after(lines->where(), row->t, trajectory.back().t);
    trajectory.push_back(*row);
  }
  if (trajectory.empty()) return Error{path, "no poses", layout.row};
  return trajectory;
}

void append_number(std::string& line, char separator, double value, int decimals) {
  std::array<char, 352> buffer{};  // the largest double has 309 digits before the point
  const auto end =
      std::to_chars(buffer.data(), buffer.data() + buffer.size(), value, std::chars_format::fixed, decimals)
          .ptr;
  line += separator;
  line.append(buffer.data(), end);
}

}  // namespace evpose
