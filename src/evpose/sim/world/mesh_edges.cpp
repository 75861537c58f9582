// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/world/mesh_edges.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <optional>
#include <tuple>
#include <utility>

#include "evpose/sim/world/disjoint_sets.h"
#include "evpose/sim/world/mesh_builder.h"

namespace evpose::sim {
namespace {

constexpr double kWeld_m = 2e-5;  // vertices nearer than this are one: above the rounding of floats at 100 m
constexpr double kSmoothNormals =
    0.03;  // rad between the corner normals of two triangles of one smooth surface
constexpr double kSharpestBend = 30 * 3.14159265358979 / 180;  // within a chain

// Numbers vertices; vertices closer than kWeld_m have the same number.
class Welder {
 public:
  std::int32_t number(const Eigen::Vector3d& p) {
    const Eigen::Vector3d place = p / kWeld_m;
    const auto cell = [](double x) { return static_cast<std::int64_t>(std::floor(x)); };
    const std::int64_t i = cell(place.x()), j = cell(place.y()), k = cell(place.z());
    for (std::int64_t a = i - 1; a <= i + 1; ++a)
      for (std::int64_t b = j - 1; b <= j + 1; ++b)
        for (std::int64_t c = k - 1; c <= k + 1; ++c)
          if (const auto found = numbers_.find({a, b, c});
              found != numbers_.end() &&
              (points_[static_cast<std::size_t>(found->second)] - p).norm() < kWeld_m)
            return found->second;
    points_.push_back(p);
    return numbers_[{i, j, k}] = static_cast<std::int32_t>(points_.size() - 1);
  }
  const Eigen::Vector3d& point(std::int32_t number) const {
    return points_[static_cast<std::size_t>(number)];
  }

 private:
  std::map<std::tuple<std::int64_t, std::int64_t, std::int64_t>, std::int32_t> numbers_;
  std::vector<Eigen::Vector3d> points_;
};

using VertexPair = std::pair<std::int32_t, std::int32_t>;
struct EdgeSide {
  std::size_t triangle;
  int corner;  // first corner of the edge
};

struct EdgeSegment {
  VertexPair ends;
  std::pair<std::int32_t, std::int32_t> surfaces;  // -1: none
};

class EdgeFinder {
 public:
  EdgeFinder(const Mesh& mesh, double crease_rad) : mesh_(mesh), cosine_(std::cos(crease_rad)) {
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
      std::array<std::int32_t, 3> own{};
      for (std::size_t k = 0; k < 3; ++k)
        own[k] = welder_.number(mesh.vertices[mesh.triangles[i][k]].cast<double>());
      welded_.push_back(own);
      normals_.push_back(triangle_normal(mesh, i));
      for (int k = 0; k < 3; ++k) {
        const VertexPair ends =
            std::minmax(own[static_cast<std::size_t>(k)], own[static_cast<std::size_t>((k + 1) % 3)]);
        if (ends.first != ends.second) edges_[ends].push_back({i, k});
      }
    }
  }

  MeshEdges find() {
    MeshEdges out;
    DisjointSets groups(mesh_.triangles.size());
    std::vector<const std::pair<const VertexPair, std::vector<EdgeSide>>*> sharp;
    for (const auto& edge : edges_) {
      const std::vector<EdgeSide>& sides = edge.second;
      if (sides.size() == 2 && is_smooth(sides[0], sides[1]))
        groups.join(sides[0].triangle, sides[1].triangle);
      else
        sharp.push_back(&edge);
    }
    std::vector<std::int32_t> number(mesh_.triangles.size(), -1);
    std::int32_t count = 0;
    for (std::size_t i = 0; i < mesh_.triangles.size(); ++i) {
      std::int32_t& own = number[groups.root(i)];
      if (own < 0) own = count++;
      out.surface_of.push_back(own);
    }
    for (const auto* edge : sharp) {
      const std::vector<EdgeSide>& sides = edge->second;
      const std::int32_t a = out.surface_of[sides[0].triangle],
                         b = sides.size() > 1 ? out.surface_of[sides[1].triangle] : -1;
      segments_.push_back({edge->first, std::minmax(a, b)});
    }
    build_chains(out);
    return out;
  }

 private:
  // Within the crease angle, or shaded as one smooth body.
  bool is_smooth(const EdgeSide& a, const EdgeSide& b) const {
    if (normals_[a.triangle].dot(normals_[b.triangle]) > cosine_) return true;
    const auto smooth_at = [&](std::int32_t vertex) {
      const auto normal = [&](std::size_t triangle) {
        for (std::size_t k = 0; k < 3; ++k)
          if (welded_[triangle][k] == vertex) return mesh_.normals[triangle][k];
        return Eigen::Vector3f(0, 0, 0);
      };
      return (normal(a.triangle) - normal(b.triangle)).norm() < kSmoothNormals;
    };
    const auto& corners = welded_[a.triangle];
    return smooth_at(corners[static_cast<std::size_t>(a.corner)]) &&
           smooth_at(corners[static_cast<std::size_t>((a.corner + 1) % 3)]);
  }

  Eigen::Vector3d direction(std::size_t segment, std::int32_t from) const {
    const VertexPair& ends = segments_[segment].ends;
    const Eigen::Vector3d d = welder_.point(ends.second) - welder_.point(ends.first);
    return (ends.first == from ? d : Eigen::Vector3d(-d)).normalized();
  }
  static std::int32_t other_end(const VertexPair& ends, std::int32_t from) {
    return ends.first == from ? ends.second : ends.first;
  }

  // The unused segment that continues another one at a vertex, if any.
  std::optional<std::size_t> next_segment(std::size_t segment, std::int32_t at) const {
    const Eigen::Vector3d heading = -direction(segment, at);
    std::optional<std::size_t> best;
    double straightest = std::cos(kSharpestBend);
    for (const std::size_t other : at_vertex_.at(at)) {
      if (other == segment || used_[other] || segments_[other].surfaces != segments_[segment].surfaces)
        continue;
      const double along = heading.dot(direction(other, at));
      if (along <= straightest) continue;
      straightest = along;
      best = other;
    }
    return best;
  }

  void build_chains(MeshEdges& out) {
    for (std::size_t i = 0; i < segments_.size(); ++i) {
      at_vertex_[segments_[i].ends.first].push_back(i);
      at_vertex_[segments_[i].ends.second].push_back(i);
    }
    used_.assign(segments_.size(), false);
    for (std::size_t i = 0; i < segments_.size(); ++i) {
      if (used_[i]) continue;
      used_[i] = true;
      std::vector<std::int32_t> forward = follow_chain(i, segments_[i].ends.second),
                                back = follow_chain(i, segments_[i].ends.first);
      EdgeChain chain;
      for (auto it = back.rbegin(); it != back.rend(); ++it) chain.points.push_back(welder_.point(*it));
      for (const std::int32_t v : forward) chain.points.push_back(welder_.point(v));
      out.chains.push_back(std::move(chain));
    }
  }
  // The vertices of the chain from `at` on, away from the segment.
  std::vector<std::int32_t> follow_chain(std::size_t segment, std::int32_t at) {
    std::vector<std::int32_t> vertices = {at};
    while (const auto following = next_segment(segment, at)) {
      segment = *following;
      used_[segment] = true;
      at = other_end(segments_[segment].ends, at);
      vertices.push_back(at);
    }
    return vertices;
  }

  const Mesh& mesh_;
  double cosine_;
  Welder welder_;
  std::vector<std::array<std::int32_t, 3>> welded_;
  std::vector<Eigen::Vector3d> normals_;
  std::map<VertexPair, std::vector<EdgeSide>> edges_;
  std::vector<EdgeSegment> segments_;
  std::map<std::int32_t, std::vector<std::size_t>> at_vertex_;
  std::vector<bool> used_;
};

}  // namespace

MeshEdges find_edges(const Mesh& mesh, double crease_rad) { return EdgeFinder(mesh, crease_rad).find(); }

}  // namespace evpose::sim
