// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_build/plane_contacts.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace evpose::map_build {

std::map<PlanePair, Contact> find_contacts(const SurfacePoints& surface, const Planes& planes) {
  std::map<PlanePair, Contact> contacts;
  for (std::size_t i = 0; i < surface.size(); ++i) {
    const std::int32_t own = planes.label[i];
    if (own < 0) continue;
    for (int k = 0; k < SurfacePoints::kLinks; ++k) {
      const std::int32_t other =
          planes.label[surface.links[i * SurfacePoints::kLinks + static_cast<std::size_t>(k)]];
      if (other < 0 || other == own) continue;
      Contact& contact = contacts[std::minmax(own, other)];
      contact.sum += surface.position[i].cast<double>();
      ++contact.count;
    }
  }
  return contacts;
}

Line intersection(const FittedPlane& a, const FittedPlane& b, const Eigen::Vector3d& near) {
  Line line;
  line.direction = a.normal.cross(b.normal).normalized();
  Eigen::Matrix3d rows;
  rows << a.normal.transpose(), b.normal.transpose(), line.direction.transpose();
  const Eigen::Vector3d right(-a.d, -b.d, line.direction.dot(near));
  line.origin = rows.partialPivLu().solve(right);
  return line;
}

double width_across(const SurfacePoints& surface, const FittedPlane& plane, const Line& line) {
  const Eigen::Vector3d across = line.direction.cross(plane.normal);
  double sum = 0;
  for (const std::uint32_t i : plane.points) {
    const double d = across.dot(surface.position[i].cast<double>() - plane.centre);
    sum += d * d;
  }
  return std::sqrt(12 * sum / static_cast<double>(plane.points.size()));
}

}  // namespace evpose::map_build
