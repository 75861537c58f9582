// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/scene_contours.h"

#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <vector>

namespace evpose::sim {
namespace {

// Around an edge the scene is looked at in so many directions, this far from it.
constexpr int kDirections = 24;
constexpr double kReach = 2e-3;
// Two sides whose free angle is within this of a half turn are one plane.
constexpr double kSeam = 10 * std::numbers::pi / 180;

struct Edge {
  Eigen::Vector3d from, to;            // map frame
  Eigen::Vector3d across, along_side;  // unit, spanning the plane across the edge
};

std::vector<Edge> edges(const Box& box) {
  std::vector<Edge> all;
  for (int axis = 0; axis < 3; ++axis) {
    const int b = (axis + 1) % 3, c = (axis + 2) % 3;
    for (const double sign_b : {-1.0, 1.0}) {
      for (const double sign_c : {-1.0, 1.0}) {
        Eigen::Vector3d corner = Eigen::Vector3d::Zero();
        corner[b] = sign_b * box.half[b];
        corner[c] = sign_c * box.half[c];
        const Eigen::Vector3d reach = box.half[axis] * Eigen::Vector3d::Unit(axis);
        const auto turn = [&](int i) { return Eigen::Vector3d(box.T_map_box.q * Eigen::Vector3d::Unit(i)); };
        all.push_back({box.T_map_box * (corner - reach), box.T_map_box * (corner + reach), turn(b), turn(c)});
      }
    }
  }
  return all;
}

// The face that `direction` from a point on the surface runs along: the one through both.
std::optional<Face> face_along(const Scene& scene, const Eigen::Vector3d& point,
                               const Eigen::Vector3d& direction) {
  for (std::size_t b = 0; b < scene.boxes.size(); ++b) {
    const Box& box = scene.boxes[b];
    const Eigen::Vector3d p = box.T_map_box.inverse() * (point + kReach * direction);
    for (BoxSide side = 0; side < 6; ++side) {
      const int axis = axis_of(side);
      if (std::abs(p[axis] - sign_of(side) * box.half[axis]) > 0.1 * kReach) continue;
      const Eigen::Vector3d beyond = p.cwiseAbs() - box.half;
      if ((beyond.array() < 0.1 * kReach).all()) return face_of(b, side);
    }
  }
  return std::nullopt;
}

// The free space around a point of an edge, if it is one sector.
struct Sector {
  double begin, end;  // rad, in the plane (across, along_side)
};
std::optional<Sector> free_sector(const Scene& scene, const Eigen::Vector3d& point, const Edge& edge) {
  std::array<bool, kDirections> free{};
  // Half a step off the axes: the sides of upright boxes lie on them.
  const auto angle = [](int i) { return (i + 0.5) * 2 * std::numbers::pi / kDirections; };
  for (int i = 0; i < kDirections; ++i) {
    free[i] = !scene.solid(
        point + kReach * (std::cos(angle(i)) * edge.across + std::sin(angle(i)) * edge.along_side));
  }
  std::optional<Sector> sector;
  for (int i = 0; i < kDirections; ++i) {
    if (!free[i] || free[(i + kDirections - 1) % kDirections]) continue;
    if (sector) return std::nullopt;
    int count = 0;
    while (free[(i + count) % kDirections]) ++count;
    sector = Sector{angle(i - 1) + std::numbers::pi / kDirections,
                    angle(i + count) - std::numbers::pi / kDirections};
  }
  return sector;
}

// The contour point at a place of an edge, or nothing where the edge is buried or within a plane.
std::optional<ContourPoint> contour_point(const Scene& scene, const Eigen::Vector3d& point,
                                          const Edge& edge) {
  const std::optional<Sector> sector = free_sector(scene, point, edge);
  if (!sector || std::abs(sector->end - sector->begin - std::numbers::pi) < kSeam) return std::nullopt;
  const auto direction = [&](double a) {
    return Eigen::Vector3d(std::cos(a) * edge.across + std::sin(a) * edge.along_side);
  };
  const Eigen::Vector3d along_a = direction(sector->begin), along_b = direction(sector->end);
  const auto face_a = face_along(scene, point, along_a), face_b = face_along(scene, point, along_b);
  if (!face_a || !face_b) return std::nullopt;
  ContourPoint p;
  p.position = point.cast<float>();
  p.normal = (-along_a).cast<float>();
  p.tangent = (edge.to - edge.from).normalized().cast<float>();
  p.plane_a = *face_a;
  p.plane_b = *face_b;
  p.kind = ContourKind::crease;
  return p;
}

void add_faces(const Box& box, TriangleMesh& mesh) {
  for (BoxSide side = 0; side < 6; ++side) {
    const int axis = axis_of(side), u = texture_u_axis(side), v = texture_v_axis(side);
    const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
    for (int i = 0; i < 4; ++i) {  // round the face
      Eigen::Vector3d corner = Eigen::Vector3d::Zero();
      corner[axis] = sign_of(side) * box.half[axis];
      corner[u] = (i == 1 || i == 2 ? 1 : -1) * box.half[u];
      corner[v] = (i >= 2 ? 1 : -1) * box.half[v];
      mesh.vertices.push_back((box.T_map_box * corner).cast<float>());
    }
    mesh.triangles.push_back({first, first + 1, first + 2});
    mesh.triangles.push_back({first, first + 2, first + 3});
  }
}

}  // namespace

ContourMap make_contours(const Scene& scene, double spacing_m) {
  ContourMap map;
  std::int32_t contour = -1;
  for (const Box& box : scene.boxes) {
    for (const Edge& edge : edges(box)) {
      const double length = (edge.to - edge.from).norm();
      const int count = std::max(1, static_cast<int>(std::lround(length / spacing_m)));
      std::optional<ContourPoint> before;
      for (int i = 0; i < count; ++i) {
        std::optional<ContourPoint> p =
            contour_point(scene, edge.from + (i + 0.5) / count * (edge.to - edge.from), edge);
        if (p) {
          const bool continues = before && before->plane_a == p->plane_a && before->plane_b == p->plane_b;
          p->contour = continues ? contour : ++contour;
          p->length = static_cast<float>(length / count);
          map.points.push_back(*p);
        }
        before = p;
      }
    }
    add_faces(box, map.occluders);
  }
  return map;
}

}  // namespace evpose::sim
