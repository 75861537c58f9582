// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/motion/waypoints.h"

#include <array>
#include <cmath>

#include "evpose/io/files/row_reader.h"

namespace evpose {

Expected<std::vector<Waypoint>> read_waypoints(const std::string& path) {
  static const std::string kRow = "a row is `x y z yaw_deg [pause_s]`";
  constexpr double kFarthest = 1e6;  // metres, degrees, seconds
  auto rows = RowReader::open(path);
  if (!rows) return rows.error();
  std::vector<Waypoint> points;
  while (true) {
    const auto more = rows->next();
    if (!more) return more.error();
    if (!*more) break;
    const auto& fields = rows->fields();
    if (fields.size() != 4 && fields.size() != 5)
      return Error{rows->where(), text(fields.size(), " values instead of 4 or 5"), kRow};
    std::array<double, 5> v{};
    if (auto status = rows->numbers(0, std::span(v).first(fields.size()), kRow); !status)
      return status.error();
    for (std::size_t k = 0; k < fields.size(); ++k)
      if (std::abs(v[k]) > kFarthest)
        return Error{rows->where(), text("'", fields[k], "' is not a number of sensible size"), kRow};
    if (v[4] < 0) return Error{rows->where(), text("a pause of ", v[4], " s"), "make it 0 or more"};
    points.push_back({{v[0], v[1], v[2]}, v[3], v[4]});
  }
  if (points.size() < 2) return Error{path, text(points.size(), " waypoints"), "give two or more; " + kRow};
  return points;
}

}  // namespace evpose
