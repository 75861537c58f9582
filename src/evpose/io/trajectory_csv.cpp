// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/trajectory_csv.h"

#include <array>
#include <cmath>

#include "evpose/io/input_file.h"
#include "evpose/io/numbers.h"

namespace evpose {
namespace {

const std::string kRow = "a row is `timestamp_ns,px,py,pz,qw,qx,qy,qz`";

Expected<TimedPose> parse_row(const std::vector<std::string_view>& fields, const std::string& where) {
  if (fields.size() < 8) return Error{where, text(fields.size(), " values instead of 8"), kRow};
  TimedPose row;
  if (!parse_integer(fields[0], row.t) || row.t > kLargestTimeNs || row.t < -kLargestTimeNs)
    return Error{where, text("'", fields[0], "' is not a time in nanoseconds"), kRow};
  std::array<double, 7> v{};
  for (std::size_t k = 0; k < v.size(); ++k)
    if (!parse_number(fields[k + 1], v[k]) || !std::isfinite(v[k]))
      return Error{where, text("'", fields[k + 1], "' is not a finite number"), kRow};
  row.pose.p = {v[0], v[1], v[2]};
  row.pose.q = Eigen::Quaterniond(v[3], v[4], v[5], v[6]);
  const double norm = row.pose.q.norm();
  if (!(std::abs(norm - 1) <= 1e-2))
    return Error{where, text("the quaternion's norm is ", norm, ", not 1"), kRow};
  row.pose.q.normalize();
  return row;
}

}  // namespace

Expected<std::vector<TimedPose>> read_trajectory_csv(const std::string& path) {
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
                   text("the stamp ", row->t, " ns does not come after ", trajectory.back().t, " ns"),
                   "sort the file by time and remove repeated stamps"};
    trajectory.push_back(*row);
  }
  if (trajectory.empty()) return Error{path, "no poses", kRow};
  return trajectory;
}

}  // namespace evpose
