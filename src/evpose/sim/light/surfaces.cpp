// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/light/surfaces.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <unordered_map>
#include <utility>

#include "evpose/sim/world/disjoint_sets.h"

namespace evpose::sim {
namespace {

constexpr double kSamePlace_m = 1e-5;
constexpr double kSameTexture_m = 1e-4;
constexpr double kSameNormal = 1e-5;  // 1 - cosine: 0.26 degrees

// Number of each vertex; vertices at the same position have the same number.
std::vector<std::uint32_t> weld_vertices(const std::vector<Eigen::Vector3f>& vertices) {
  std::map<std::array<std::int64_t, 3>, std::uint32_t> places;
  std::vector<std::uint32_t> welded(vertices.size());
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    std::array<std::int64_t, 3> key{};
    for (int k = 0; k < 3; ++k) key[k] = std::llround(vertices[i][k] / kSamePlace_m);
    welded[i] = places.emplace(key, static_cast<std::uint32_t>(places.size())).first->second;
  }
  return welded;
}

Patch triangle_patch(const Mesh& mesh, std::size_t triangle) {
  const Mesh::Corners& corners = mesh.triangles[triangle];
  const Eigen::Vector3d a = mesh.vertices[corners[0]].cast<double>(),
                        b = mesh.vertices[corners[1]].cast<double>(),
                        c = mesh.vertices[corners[2]].cast<double>();
  Patch patch;
  const Eigen::Vector3d ab = b - a, ac = c - a, cross = ab.cross(ac);
  const double area2 = cross.norm();
  patch.normal = area2 > 0 ? Eigen::Vector3d(cross / area2) : Eigen::Vector3d::UnitZ();
  // Corner normals tell the outside.
  if (patch.normal.dot(mesh.normals[triangle][0].cast<double>()) < 0) patch.normal = -patch.normal;
  patch.offset = -patch.normal.dot(a);
  // Gradient of a function given at the corners, within the plane.
  const auto gradient = [&](double at_a, double at_b, double at_c) -> Eigen::Vector3d {
    if (!(area2 > 0)) return Eigen::Vector3d::Zero();
    const Eigen::Vector3d n = cross / area2;
    return ((at_b - at_a) * ac.cross(n) + (at_c - at_a) * n.cross(ab)) / area2;
  };
  const auto& uv = mesh.uv[triangle];
  patch.u_axis = gradient(uv[0].x(), uv[1].x(), uv[2].x());
  patch.v_axis = gradient(uv[0].y(), uv[1].y(), uv[2].y());
  patch.u0 = uv[0].x() - patch.u_axis.dot(a);
  patch.v0 = uv[0].y() - patch.v_axis.dot(a);
  patch.material = mesh.material[triangle];
  patch.object = mesh.object[triangle];
  return patch;
}

struct EdgeSide {
  std::size_t triangle;
  int edge;
};
using VertexPair = std::pair<std::uint32_t, std::uint32_t>;
using EdgeSides = std::map<VertexPair, std::vector<EdgeSide>>;

// The triangles on both sides of each edge.
EdgeSides collect_edge_sides(const Mesh& mesh, const std::vector<std::uint32_t>& place) {
  EdgeSides sides;
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    for (int e = 0; e < 3; ++e) {
      const std::uint32_t a = place[mesh.triangles[i][e]], b = place[mesh.triangles[i][(e + 1) % 3]];
      sides[{std::min(a, b), std::max(a, b)}].push_back({i, e});
    }
  }
  return sides;
}

struct EdgeContinuity {
  bool normal = true, texture = true;
};

// What continues across the edge that two triangles have in common.
EdgeContinuity edge_continuity(const Mesh& mesh, const std::vector<std::uint32_t>& place, const EdgeSide& p,
                               const EdgeSide& q) {
  // The common corners in both triangles.
  const std::array<int, 2> in_p{p.edge, (p.edge + 1) % 3};
  std::array<int, 2> in_q{q.edge, (q.edge + 1) % 3};
  if (place[mesh.triangles[p.triangle][in_p[0]]] != place[mesh.triangles[q.triangle][in_q[0]]])
    std::swap(in_q[0], in_q[1]);
  EdgeContinuity out;
  for (int k = 0; k < 2; ++k) {
    const Eigen::Vector3f &normal_p = mesh.normals[p.triangle][in_p[k]],
                          &normal_q = mesh.normals[q.triangle][in_q[k]];
    const Eigen::Vector2f &uv_p = mesh.uv[p.triangle][in_p[k]], &uv_q = mesh.uv[q.triangle][in_q[k]];
    out.normal = out.normal && 1 - normal_p.dot(normal_q) < static_cast<float>(kSameNormal);
    out.texture = out.texture && (uv_p - uv_q).norm() < static_cast<float>(kSameTexture_m);
  }
  return out;
}

bool have_same_mapping(const Patch& p, const Patch& q) {
  const bool flat = 1 - p.normal.dot(q.normal) < 1e-9;
  return flat && (p.u_axis - q.u_axis).norm() < 1e-3 && (p.v_axis - q.v_axis).norm() < 1e-3;
}

}  // namespace

PartSurfaces segment_surfaces(const Mesh& mesh, std::int32_t& first) {
  const std::size_t n = mesh.triangles.size();
  const std::vector<std::uint32_t> place = weld_vertices(mesh.vertices);
  std::vector<Patch> planes;
  planes.reserve(n);
  for (std::size_t i = 0; i < n; ++i) planes.push_back(triangle_patch(mesh, i));

  DisjointSets patches(n), groups(n), surfaces(n);
  PartSurfaces out;
  out.edges.assign(n, 7);
  for (const auto& [key, sides] : collect_edge_sides(mesh, place)) {
    if (sides.size() != 2 || key.first == key.second) continue;
    const auto [p, e] = sides[0];
    const auto [q, f] = sides[1];
    const EdgeContinuity same = edge_continuity(mesh, place, sides[0], sides[1]);
    if (!same.normal) continue;
    surfaces.join(p, q);
    if (planes[p].object != planes[q].object || planes[p].material != planes[q].material || !same.texture)
      continue;
    groups.join(p, q);
    if (!have_same_mapping(planes[p], planes[q])) continue;
    patches.join(p, q);
    out.edges[p] = static_cast<std::uint8_t>(out.edges[p] & ~(1 << e));
    out.edges[q] = static_cast<std::uint8_t>(out.edges[q] & ~(1 << f));
  }

  std::unordered_map<std::size_t, std::int32_t> number;
  out.patch_of.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t root = patches.root(i);
    const auto [at, fresh] = number.emplace(root, static_cast<std::int32_t>(out.patches.size()));
    if (fresh) {
      Patch patch = planes[root];
      patch.group = first + static_cast<std::int32_t>(groups.root(root));
      patch.surface = first + static_cast<std::int32_t>(surfaces.root(root));
      out.patches.push_back(std::move(patch));
    }
    out.patch_of[i] = at->second;
  }
  first += static_cast<std::int32_t>(n);
  return out;
}

}  // namespace evpose::sim
