// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/motion/waypoints.h"

#include <array>
#include <cmath>

#include "evpose/io/files/input_file.h"
#include "evpose/io/files/numbers.h"

namespace evpose {

Expected<std::vector<Waypoint>> read_waypoints(const std::string& path) {
  static const std::string kRow = "a row is `x y z yaw_deg [pause_s]`";
  constexpr double kFarthest = 1e6;  // metres, degrees, seconds
  auto lines = LineReader::open(path);
  if (!lines) return lines.error();
  std::vector<Waypoint> points;
  std::vector<std::string_view> fields;
  std::string_view line;
  while (true) {
    const auto more = lines->next(line);
    if (!more) return more.error();
    if (!*more) break;
    line = trimmed(line);
    if (line.empty() || line.front() == '#') continue;
    split_fields(line, fields);
    if (fields.size() != 4 && fields.size() != 5)
      return Error{lines->where(), text(fields.size(), " values instead of 4 or 5"), kRow};
    std::array<double, 5> v{};
    for (std::size_t k = 0; k < fields.size(); ++k)
      if (!parse_number(fields[k], v[k]) || !(std::abs(v[k]) <= kFarthest))
        return Error{lines->where(), text("'", fields[k], "' is not a number of sensible size"), kRow};
    if (v[4] < 0) return Error{lines->where(), text("a pause of ", v[4], " s"), "make it 0 or more"};
    points.push_back({{v[0], v[1], v[2]}, v[3], v[4]});
  }
  if (points.size() < 2) return Error{path, text(points.size(), " waypoints"), "give two or more; " + kRow};
  return points;
}

}  // namespace evpose
