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

#include "evpose/sim/world/mesh_builder.h"

namespace evpose::sim {
namespace {

constexpr double kWeld_m = 2e-5;  // corners nearer than this are one: above the rounding of floats at 100 m
constexpr double kSmooth = 0.03;  // rad between the corner normals of two triangles that run on smoothly
constexpr double kBend = 30 * 3.14159265358979 / 180;  // of a run

// Numbers for places, the same for places within the weld.
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

class Groups {
 public:
  explicit Groups(std::size_t count) : parent_(count) {
    std::iota(parent_.begin(), parent_.end(), std::size_t{0});
  }
  std::size_t find(std::size_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void join(std::size_t a, std::size_t b) {
    a = find(a);
    b = find(b);
    parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<std::size_t> parent_;
};

using Ends = std::pair<std::int32_t, std::int32_t>;
struct Side {
  std::size_t triangle;
  int corner;  // the edge goes from here to the next
};

struct Piece {
  Ends ends;
  std::pair<std::int32_t, std::int32_t> surfaces;  // -1: none
};

class Finder {
 public:
  Finder(const Mesh& mesh, double crease_rad) : mesh_(mesh), cosine_(std::cos(crease_rad)) {
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
      std::array<std::int32_t, 3> own{};
      for (std::size_t k = 0; k < 3; ++k)
        own[k] = welder_.number(mesh.vertices[mesh.triangles[i][k]].cast<double>());
      welded_.push_back(own);
      normals_.push_back(triangle_normal(mesh, i));
      for (int k = 0; k < 3; ++k) {
        const Ends ends =
            std::minmax(own[static_cast<std::size_t>(k)], own[static_cast<std::size_t>((k + 1) % 3)]);
        if (ends.first != ends.second) edges_[ends].push_back({i, k});
      }
    }
  }

  MeshEdges find() {
    MeshEdges out;
    Groups groups(mesh_.triangles.size());
    std::vector<const std::pair<const Ends, std::vector<Side>>*> sharp;
    for (const auto& edge : edges_) {
      const std::vector<Side>& sides = edge.second;
      if (sides.size() == 2 && runs_on(sides[0], sides[1]))
        groups.join(sides[0].triangle, sides[1].triangle);
      else
        sharp.push_back(&edge);
    }
    std::vector<std::int32_t> number(mesh_.triangles.size(), -1);
    std::int32_t count = 0;
    for (std::size_t i = 0; i < mesh_.triangles.size(); ++i) {
      std::int32_t& own = number[groups.find(i)];
      if (own < 0) own = count++;
      out.surface_of.push_back(own);
    }
    for (const auto* edge : sharp) {
      const std::vector<Side>& sides = edge->second;
      const std::int32_t a = out.surface_of[sides[0].triangle],
                         b = sides.size() > 1 ? out.surface_of[sides[1].triangle] : -1;
      pieces_.push_back({edge->first, std::minmax(a, b)});
    }
    chain(out);
    return out;
  }

 private:
  // Within the crease angle, or shaded as one smooth body.
  bool runs_on(const Side& a, const Side& b) const {
    if (normals_[a.triangle].dot(normals_[b.triangle]) > cosine_) return true;
    const auto smooth_at = [&](std::int32_t vertex) {
      const auto normal = [&](std::size_t triangle) {
        for (std::size_t k = 0; k < 3; ++k)
          if (welded_[triangle][k] == vertex) return mesh_.normals[triangle][k];
        return Eigen::Vector3f(0, 0, 0);
      };
      return (normal(a.triangle) - normal(b.triangle)).norm() < kSmooth;
    };
    const auto& corners = welded_[a.triangle];
    return smooth_at(corners[static_cast<std::size_t>(a.corner)]) &&
           smooth_at(corners[static_cast<std::size_t>((a.corner + 1) % 3)]);
  }

  Eigen::Vector3d direction(std::size_t piece, std::int32_t from) const {
    const Ends& ends = pieces_[piece].ends;
    const Eigen::Vector3d d = welder_.point(ends.second) - welder_.point(ends.first);
    return (ends.first == from ? d : Eigen::Vector3d(-d)).normalized();
  }
  static std::int32_t other_end(const Ends& ends, std::int32_t from) {
    return ends.first == from ? ends.second : ends.first;
  }

  // The piece that carries on from the end of another.
  std::optional<std::size_t> next(std::size_t piece, std::int32_t at) const {
    const Eigen::Vector3d heading = -direction(piece, at);
    std::optional<std::size_t> best;
    double straightest = std::cos(kBend);
    for (const std::size_t other : at_vertex_.at(at)) {
      if (other == piece || used_[other] || pieces_[other].surfaces != pieces_[piece].surfaces) continue;
      const double along = heading.dot(direction(other, at));
      if (along <= straightest) continue;
      straightest = along;
      best = other;
    }
    return best;
  }

  void chain(MeshEdges& out) {
    for (std::size_t i = 0; i < pieces_.size(); ++i) {
      at_vertex_[pieces_[i].ends.first].push_back(i);
      at_vertex_[pieces_[i].ends.second].push_back(i);
    }
    used_.assign(pieces_.size(), false);
    for (std::size_t i = 0; i < pieces_.size(); ++i) {
      if (used_[i]) continue;
      used_[i] = true;
      std::vector<std::int32_t> forward = walk(i, pieces_[i].ends.second),
                                back = walk(i, pieces_[i].ends.first);
      EdgeRun run;
      for (auto it = back.rbegin(); it != back.rend(); ++it) run.points.push_back(welder_.point(*it));
      for (const std::int32_t v : forward) run.points.push_back(welder_.point(v));
      out.runs.push_back(std::move(run));
    }
  }
  // The vertices from `at` on, away from the piece.
  std::vector<std::int32_t> walk(std::size_t piece, std::int32_t at) {
    std::vector<std::int32_t> vertices = {at};
    while (const auto following = next(piece, at)) {
      piece = *following;
      used_[piece] = true;
      at = other_end(pieces_[piece].ends, at);
      vertices.push_back(at);
    }
    return vertices;
  }

  const Mesh& mesh_;
  double cosine_;
  Welder welder_;
  std::vector<std::array<std::int32_t, 3>> welded_;
  std::vector<Eigen::Vector3d> normals_;
  std::map<Ends, std::vector<Side>> edges_;
  std::vector<Piece> pieces_;
  std::map<std::int32_t, std::vector<std::size_t>> at_vertex_;
  std::vector<bool> used_;
};

}  // namespace

MeshEdges find_edges(const Mesh& mesh, double crease_rad) { return Finder(mesh, crease_rad).find(); }

}  // namespace evpose::sim
