// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/light/surfaces.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <unordered_map>

namespace evpose::sim {
namespace {

constexpr double kSamePlace_m = 1e-5;
constexpr double kSameTexture_m = 1e-4;
constexpr double kSameNormal = 1e-5;  // 1 - cosine: 0.26 degrees

class Sets {
 public:
  explicit Sets(std::size_t n) : parent_(n) { std::iota(parent_.begin(), parent_.end(), 0); }
  std::size_t root(std::size_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  // The lower number stays the root, so that the order of patches is that of the mesh.
  void join(std::size_t a, std::size_t b) {
    a = root(a);
    b = root(b);
    parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<std::size_t> parent_;
};

// Numbers of places: vertices at the same place have the same.
std::vector<std::uint32_t> weld(const std::vector<Eigen::Vector3f>& vertices) {
  std::map<std::array<std::int64_t, 3>, std::uint32_t> places;
  std::vector<std::uint32_t> welded(vertices.size());
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    std::array<std::int64_t, 3> key{};
    for (int k = 0; k < 3; ++k) key[k] = std::llround(vertices[i][k] / kSamePlace_m);
    welded[i] = places.emplace(key, static_cast<std::uint32_t>(places.size())).first->second;
  }
  return welded;
}

Patch plane_of(const Mesh& mesh, std::size_t triangle) {
  const Mesh::Corners& corners = mesh.triangles[triangle];
  const Eigen::Vector3d a = mesh.vertices[corners[0]].cast<double>(),
                        b = mesh.vertices[corners[1]].cast<double>(),
                        c = mesh.vertices[corners[2]].cast<double>();
  Patch patch;
  const Eigen::Vector3d ab = b - a, ac = c - a, cross = ab.cross(ac);
  const double area2 = cross.norm();
  patch.normal = area2 > 0 ? Eigen::Vector3d(cross / area2) : Eigen::Vector3d::UnitZ();
  // Corner normals say which side is out.
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

struct Side {
  std::size_t triangle;
  int edge;
};

}  // namespace

PartSurfaces order_surfaces(const Mesh& mesh, std::int32_t& first) {
  const std::size_t n = mesh.triangles.size();
  const std::vector<std::uint32_t> place = weld(mesh.vertices);
  std::vector<Patch> planes;
  planes.reserve(n);
  for (std::size_t i = 0; i < n; ++i) planes.push_back(plane_of(mesh, i));

  std::map<std::pair<std::uint32_t, std::uint32_t>, std::vector<Side>> sides;
  for (std::size_t i = 0; i < n; ++i) {
    for (int e = 0; e < 3; ++e) {
      const std::uint32_t a = place[mesh.triangles[i][e]], b = place[mesh.triangles[i][(e + 1) % 3]];
      sides[{std::min(a, b), std::max(a, b)}].push_back({i, e});
    }
  }

  Sets patches(n), groups(n), surfaces(n);
  PartSurfaces out;
  out.edges.assign(n, 7);
  for (const auto& [key, two] : sides) {
    if (two.size() != 2 || key.first == key.second) continue;
    const auto [p, e] = two[0];
    const auto [q, f] = two[1];
    // The shared corners in both triangles.
    std::array<int, 2> in_p{e, (e + 1) % 3}, in_q{f, (f + 1) % 3};
    if (place[mesh.triangles[p][in_p[0]]] != place[mesh.triangles[q][in_q[0]]]) std::swap(in_q[0], in_q[1]);
    bool same_normal = true, same_texture = planes[p].material == planes[q].material;
    for (int k = 0; k < 2; ++k) {
      same_normal = same_normal && 1 - mesh.normals[p][in_p[k]].dot(mesh.normals[q][in_q[k]]) <
                                       static_cast<float>(kSameNormal);
      same_texture = same_texture &&
                     (mesh.uv[p][in_p[k]] - mesh.uv[q][in_q[k]]).norm() < static_cast<float>(kSameTexture_m);
    }
    if (!same_normal) continue;
    surfaces.join(p, q);
    if (planes[p].object != planes[q].object || !same_texture) continue;
    groups.join(p, q);
    const bool flat = 1 - planes[p].normal.dot(planes[q].normal) < 1e-9;
    const bool same_mapping = (planes[p].u_axis - planes[q].u_axis).norm() < 1e-3 &&
                              (planes[p].v_axis - planes[q].v_axis).norm() < 1e-3;
    if (!flat || !same_mapping) continue;
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
