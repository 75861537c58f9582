// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_build/contour_points.h"

#include <algorithm>
#include <cmath>

namespace evpose::map_build {

void add_points(const LineSegment& segment, std::int32_t number, std::int8_t contrast, double spacing_m,
                ContourMap& map) {
  const int count = std::max(1, static_cast<int>(std::lround(segment.length_m() / spacing_m)));
  ContourPoint p;
  // Where the faces run uneven beside it, an edge is turned a little against its planes.
  const Eigen::Vector3d along = segment.tangent();
  const auto across = [&](const Eigen::Vector3d& normal) -> Eigen::Vector3f {
    const Eigen::Vector3d out = normal - along.dot(normal) * along;
    return out.norm() > 0.5 ? Eigen::Vector3f(out.normalized().cast<float>()) : Eigen::Vector3f::Zero();
  };
  p.normal = across(segment.normal_a);
  p.normal_b = across(segment.normal_b);
  p.tangent = along.cast<float>();
  p.length = static_cast<float>(segment.length_m() / count);
  p.sigma = static_cast<float>(segment.sigma_m);
  p.contour = number;
  p.plane_a = segment.plane_a;
  p.plane_b = segment.plane_b;
  p.kind = segment.kind;
  p.contrast = contrast;
  for (int k = 0; k < count; ++k) {
    p.position = (segment.begin + (segment.end - segment.begin) * ((k + 0.5) / count)).cast<float>();
    map.points.push_back(p);
  }
}

}  // namespace evpose::map_build
