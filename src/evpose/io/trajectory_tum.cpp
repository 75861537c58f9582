// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/trajectory_tum.h"

#include <array>
#include <charconv>
#include <cmath>

#include "evpose/io/atomic_file.h"
#include "evpose/io/input_file.h"
#include "evpose/io/numbers.h"

namespace evpose {
namespace {

const std::string kRow = "a row is `t tx ty tz qx qy qz qw`";

Expected<TimedPose> parse_row(const std::vector<std::string_view>& fields, const std::string& where) {
  if (fields.size() != 8) return Error{where, text(fields.size(), " values instead of 8"), kRow};
  TimedPose row;
  if (!parse_decimal(fields[0], 9, row.t) || row.t > kLargestTimeNs || row.t < -kLargestTimeNs)
    return Error{where, text("'", fields[0], "' is not a time in seconds"), kRow};
  std::array<double, 7> v{};
  for (std::size_t k = 0; k < 7; ++k) {
    if (!parse_number(fields[k + 1], v[k]) || !std::isfinite(v[k]))
      return Error{where, text("'", fields[k + 1], "' is not a finite number"), kRow};
  }
  row.pose.p = {v[0], v[1], v[2]};
  row.pose.q = Eigen::Quaterniond(v[6], v[3], v[4], v[5]);
  const double norm = row.pose.q.norm();
  if (!(std::abs(norm - 1) <= 1e-2))
    return Error{where, text("the quaternion's norm is ", norm, ", not 1"), kRow};
  row.pose.q.normalize();
  return row;
}

void append(std::string& line, double value, int decimals) {
  std::array<char, 352> buffer{};  // the largest double has 309 digits before the point
  const auto end =
      std::to_chars(buffer.data(), buffer.data() + buffer.size(), value, std::chars_format::fixed, decimals)
          .ptr;
  line += ' ';
  line.append(buffer.data(), end);
}

}  // namespace

Expected<std::vector<TimedPose>> read_tum(const std::string& path) {
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
    const auto row = parse_row(fields, lines->where());
    if (!row) return row.error();
    if (!trajectory.empty() && row->t <= trajectory.back().t)
      return Error{lines->where(),
                   text("the stamp ", format_decimal(row->t, 9), " s does not come after ",
                        format_decimal(trajectory.back().t, 9), " s"),
                   "sort the file by time and remove repeated stamps"};
    trajectory.push_back(*row);
  }
  if (trajectory.empty()) return Error{path, "no poses", kRow};
  return trajectory;
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
    for (int k = 0; k < 3; ++k) append(line, row.pose.p[k], 9);
    for (int k = 0; k < 4; ++k) append(line, q.coeffs()[k], 10);
    file->write(line + "\n");
  }
  return file->commit();
}

}  // namespace evpose
