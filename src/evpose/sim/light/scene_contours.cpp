// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/light/scene_contours.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <unordered_map>
#include <utility>
#include <vector>

#include "evpose/core/parallel.h"
#include "evpose/sim/world/mesh_builder.h"
#include "evpose/sim/world/mesh_edges.h"
#include "evpose/sim/world/random.h"

namespace evpose::sim {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kCrease = 10 * kPi / 180;
/// Radius and number of chords of the ring around an edge point in which surfaces are searched. Prints, which
/// lie 0.6 mm above their surface, bend it by 7 degrees and are no contour.
constexpr double kRingRadius_m = 5e-3;
constexpr int kChords = 24;
static_assert(kChords % RayCaster::kMostSegments == 0);
constexpr double kRingStep = 2 * kPi / kChords;
/// Angle of the first chord: avoids right angles, so that no surface chains through a corner of the ring.
constexpr double kRingStart = 0.37 * kRingStep;
constexpr double kNarrowestGap = 8 * kPi / 180;  // gaps, such as that under the rim of a print
constexpr double kBoundaryAngle = 2 * kPi - 12 * kPi / 180;

// Points of the free space from which every contour that counts is visible.
std::vector<Eigen::Vector3d> free_viewpoints(const Scene& scene, const RayCaster& rays) {
  const Eigen::Vector3d size = scene.high - scene.low;
  std::array<int, 3> count{};
  const double step = std::cbrt(std::max(1e-3, size.prod()) / 120);
  for (int i = 0; i < 3; ++i)
    count[static_cast<std::size_t>(i)] = std::clamp(static_cast<int>(std::lround(size[i] / step)), 2, 30);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < count[0]; ++i)
    for (int j = 0; j < count[1]; ++j)
      for (int k = 0; k < count[2]; ++k) {
        const Eigen::Vector3d fraction(i / (count[0] - 1.0), j / (count[1] - 1.0), k / (count[2] - 1.0));
        const Eigen::Vector3d p = scene.low + fraction.cwiseProduct(size);
        // Inside a body most rays hit back faces.
        int backs = 0, hits = 0;
        for (int a = 0; a < 26; ++a) {
          const double z = (a + 0.5) / 13 - 1, turn = 2.39996 * a;
          const Eigen::Vector3d direction(std::sqrt(1 - z * z) * std::cos(turn),
                                          std::sqrt(1 - z * z) * std::sin(turn), z);
          const auto hit = rays.trace(p, direction);
          if (!hit) continue;
          ++hits;
          if (triangle_normal(scene.mesh, hit->triangle).dot(direction) > 0) ++backs;
        }
        if (2 * backs <= hits) points.push_back(p);
      }
  return points;
}

// Asks which points one of many viewpoints sees. What hid a point from a viewpoint is remembered and tried
// first for the next point, which is mostly near: that spares most rays.
class Viewpoints {
 public:
  // Keeps references.
  Viewpoints(const Mesh& mesh, const RayCaster& rays, const std::vector<Eigen::Vector3d>& places)
      : mesh_(mesh), rays_(rays) {
    for (const Eigen::Vector3d& p : places) ordered_.push_back({p, ordered_.size()});
  }

  // Viewpoints near to `middle` are tried first.
  void begin_at(const Eigen::Vector3d& middle) {
    std::sort(ordered_.begin(), ordered_.end(), [&](const Viewpoint& a, const Viewpoint& b) {
      const double of_a = (a.place - middle).squaredNorm(), of_b = (b.place - middle).squaredNorm();
      return of_a != of_b ? of_a < of_b : a.number < b.number;
    });
  }

  // True if one of them sees `from`; it is then tried first the next time. Points of one `kind` are likely to
  // be hidden by the same things.
  bool any_sees(const Eigen::Vector3d& from, std::size_t kind) {
    if (ordered_.empty()) return false;
    if (!rays_.occluded(from, ordered_[0].place - from, 0, 1)) return true;
    if (kind >= blockers_.size()) blockers_.resize(kind + 1);
    std::vector<std::uint32_t>& blockers = blockers_[kind];
    blockers.resize(ordered_.size(), RayCaster::kNoTriangle);
    for (std::size_t v = 1; v < ordered_.size(); ++v) {
      const Eigen::Vector3d way = ordered_[v].place - from;
      std::uint32_t& blocker = blockers[ordered_[v].number];
      if (blocker != RayCaster::kNoTriangle && blocks(blocker, from, way)) continue;
      const auto hit = rays_.trace(from, way, 0, 1);
      if (hit) {
        blocker = hit->triangle;
        continue;
      }
      std::swap(ordered_[0], ordered_[v]);
      return true;
    }
    return false;
  }

 private:
  struct Viewpoint {
    Eigen::Vector3d place;
    std::size_t number;
  };

  // True if the way surely meets the triangle: not near its edges, nor near the ends of the way. After
  // Moeller and Trumbore (1997), everything multiplied by the determinant.
  bool blocks(std::uint32_t triangle, const Eigen::Vector3d& from, const Eigen::Vector3d& way) const {
    constexpr double kEdge = 1e-4, kEnd_m = 1e-4;
    const Mesh::Corners& corners = mesh_.triangles[triangle];
    const Eigen::Vector3d a = mesh_.vertices[corners[0]].cast<double>();
    const Eigen::Vector3d ab = mesh_.vertices[corners[1]].cast<double>() - a,
                          ac = mesh_.vertices[corners[2]].cast<double>() - a, to = from - a;
    const Eigen::Vector3d p = way.cross(ac), q = to.cross(ab);
    const double signed_size = ab.dot(p), sign = signed_size < 0 ? -1 : 1, size = sign * signed_size;
    const double u = sign * to.dot(p), v = sign * way.dot(q), along = sign * ac.dot(q);
    if (!(u > kEdge * size && v > kEdge * size && u + v < (1 - kEdge) * size)) return false;
    const double end = kEnd_m * size, length2 = way.squaredNorm(), rest = size - along;
    return along > 0 && rest > 0 && along * along * length2 > end * end && rest * rest * length2 > end * end;
  }

  const Mesh& mesh_;
  const RayCaster& rays_;
  std::vector<Viewpoint> ordered_;
  std::vector<std::vector<std::uint32_t>> blockers_;  // of each kind of point and viewpoint: triangle
};

class ContourProber {
 public:
  ContourProber(const Scene& scene, const RayCaster& rays, const MeshEdges& edges)
      : scene_(scene), rays_(rays), edges_(edges) {}

  /// Contour points of a chain where it is a contour; contour numbers from 0.
  std::vector<ContourPoint> probe(const EdgeChain& chain, double spacing_m, Viewpoints& viewpoints) const {
    std::vector<double> arc_length = {0};
    for (std::size_t i = 1; i < chain.points.size(); ++i)
      arc_length.push_back(arc_length.back() + (chain.points[i] - chain.points[i - 1]).norm());
    const double length = arc_length.back();
    std::vector<ContourPoint> out;
    if (length <= 0) return out;
    viewpoints.begin_at(chain.points[chain.points.size() / 2]);
    const int count = std::max(1, static_cast<int>(std::lround(length / spacing_m)));
    std::size_t segment = 1;
    int last = -2;
    for (int i = 0; i < count; ++i) {
      const double at = (i + 0.5) / count * length;
      while (arc_length[segment] < at) ++segment;
      const Eigen::Vector3d from = chain.points[segment - 1], to = chain.points[segment];
      const double along = (at - arc_length[segment - 1]) / (arc_length[segment] - arc_length[segment - 1]);
      auto point = classify_point(from + along * (to - from), (to - from).normalized(), viewpoints);
      if (!point) continue;
      const bool continues = last == i - 1 && !out.empty() && out.back().plane_a == point->plane_a &&
                             out.back().plane_b == point->plane_b;
      point->contour = out.empty() ? 0 : out.back().contour + (continues ? 0 : 1);
      point->length = static_cast<float>(length / count);
      out.push_back(*point);
      last = i;
    }
    return out;
  }

 private:
  struct Crossing {
    double angle;  // rad, about the edge
    std::uint32_t triangle;
  };
  struct CrossSection {  // the plane perpendicular to the edge
    Eigen::Vector3d point, tangent, a, b;
    Eigen::Vector3d direction(double angle) const { return std::cos(angle) * a + std::sin(angle) * b; }
  };
  struct UnitVector {
    double cosine, sine;
    explicit UnitVector(double angle) : cosine(std::cos(angle)), sine(std::sin(angle)) {}
    Eigen::Vector3d direction(const CrossSection& section) const {
      return cosine * section.a + sine * section.b;
    }
  };
  struct Chord {
    UnitVector begin, end;
  };
  static std::vector<Chord> ring_chords() {
    std::vector<Chord> ring;
    for (int i = 0; i < kChords; ++i) {
      const double angle = (i + 0.37) * kRingStep;
      ring.push_back({UnitVector(angle), UnitVector(angle + kRingStep)});
    }
    return ring;
  }

  std::optional<ContourPoint> classify_point(const Eigen::Vector3d& point, const Eigen::Vector3d& tangent,
                                             Viewpoints& viewpoints) const {
    const Eigen::Vector3d other =
        std::abs(tangent.z()) < 0.7 ? Eigen::Vector3d::UnitZ() : Eigen::Vector3d::UnitX();
    const Eigen::Vector3d a = tangent.cross(other).normalized();
    const CrossSection section{point, tangent, a, tangent.cross(a)};
    const std::vector<Crossing> crossings = ring_crossings(section);
    for (std::size_t i = 0; i < crossings.size(); ++i) {
      const Crossing& begin = crossings[i];
      const Crossing& end = crossings[(i + 1) % crossings.size()];
      const double width = end.angle - begin.angle + (i + 1 == crossings.size() ? 2 * kPi : 0);
      if (width < kNarrowestGap || std::abs(width - kPi) < kCrease) continue;
      if (!is_visible(section, begin.angle, width, i, viewpoints)) continue;
      ContourPoint p;
      p.position = point.cast<float>();
      p.tangent = tangent.cast<float>();
      p.normal = (-into_surface(section, begin)).cast<float>();
      p.plane_a = edges_.surface_of[begin.triangle];
      const bool rim = width > kBoundaryAngle;
      p.kind = rim ? ContourKind::boundary : ContourKind::crease;
      if (!rim) p.plane_b = edges_.surface_of[end.triangle];
      return p;
    }
    return std::nullopt;
  }

  // The surfaces that meet at the edge, counterclockwise.
  std::vector<Crossing> ring_crossings(const CrossSection& section) const {
    std::vector<Crossing> found;
    for (std::size_t first = 0; first < kChords; first += RayCaster::kMostSegments) {
      std::array<Eigen::Vector3d, RayCaster::kMostSegments> from, direction;
      std::array<RayCaster::Segment, RayCaster::kMostSegments> chords;
      for (std::size_t i = 0; i < from.size(); ++i) {
        const Chord& chord = ring_[first + i];
        from[i] = section.point + kRingRadius_m * chord.begin.direction(section);
        direction[i] = section.point + kRingRadius_m * chord.end.direction(section) - from[i];
        chords[i] = {direction[i].cast<float>(), 0, 1};
      }
      const unsigned free = rays_.free_segments(from, chords);
      for (std::size_t i = 0; i < from.size(); ++i)
        if ((free >> i & 1) == 0) add_crossings(section, from[i], direction[i], found);
    }
    std::stable_sort(found.begin(), found.end(),
                     [](const Crossing& x, const Crossing& y) { return x.angle < y.angle; });
    return found;
  }

  void add_crossings(const CrossSection& section, const Eigen::Vector3d& from,
                     const Eigen::Vector3d& direction, std::vector<Crossing>& found) const {
    float near = 0;
    for (int hits = 0; hits < 6; ++hits) {
      const auto hit = rays_.trace(from, direction, near, 1);
      if (!hit) break;
      const Eigen::Vector3d at = from + static_cast<double>(hit->distance) * direction - section.point;
      double turn = std::atan2(at.dot(section.b), at.dot(section.a)) - kRingStart;
      if (turn < 0) turn += 2 * kPi;
      found.push_back({turn + kRingStart, hit->triangle});
      near = hit->distance + 2e-3F;
    }
  }

  // Unit vector perpendicular to the edge, into the surface.
  Eigen::Vector3d into_surface(const CrossSection& section, const Crossing& crossing) const {
    const Eigen::Vector3d direction =
        section.tangent.cross(triangle_normal(scene_.mesh, crossing.triangle)).normalized();
    return direction.dot(section.direction(crossing.angle)) < 0 ? Eigen::Vector3d(-direction) : direction;
  }

  // True if the sector, the `number`th of its point, is visible from one of the viewpoints.
  static bool is_visible(const CrossSection& section, double begin, double width, std::size_t number,
                         Viewpoints& viewpoints) {
    const int tries = width > 0.6 * kPi ? 3 : 1;
    for (int k = 0; k < tries; ++k) {
      const double fraction = k == 0 ? 0.5 : k == 1 ? 0.2 : 0.8;
      const Eigen::Vector3d from =
          section.point + kRingRadius_m * section.direction(begin + fraction * width);
      if (viewpoints.any_sees(from, 3 * number + static_cast<std::size_t>(k))) return true;
    }
    return false;
  }

  const Scene& scene_;
  const RayCaster& rays_;
  const MeshEdges& edges_;
  std::vector<Chord> ring_ = ring_chords();
};

/// Finds contour points of coincident edges of several bodies, so that each is kept once.
class DuplicateFilter {
 public:
  explicit DuplicateFilter(double spacing_m)
      : cell_m_(8 * std::max(spacing_m, 5e-3)), reach_m_(std::max(spacing_m, 5e-3)) {}

  bool has(const ContourPoint& p) const {
    const Eigen::Array3d place = p.position.cast<double>();
    const Eigen::Array3d low = ((place - reach_m_) / cell_m_).floor(),
                         high = ((place + reach_m_) / cell_m_).floor();
    for (double x = low.x(); x <= high.x(); ++x)
      for (double y = low.y(); y <= high.y(); ++y)
        for (double z = low.z(); z <= high.z(); ++z)
          if (cell_has({x, y, z}, p)) return true;
    return false;
  }
  void add(const ContourPoint& p) {
    cells_[key((p.position.cast<double>() / cell_m_).array().floor())].push_back(
        {p.position, p.tangent, p.length});
  }

 private:
  struct Known {
    Eigen::Vector3f position, tangent;
    float length;
  };
  bool cell_has(const Eigen::Array3d& cell, const ContourPoint& p) const {
    const auto found = cells_.find(key(cell));
    if (found == cells_.end()) return false;
    return std::any_of(found->second.begin(), found->second.end(), [&](const Known& other) {
      const Eigen::Vector3f d = p.position - other.position;
      const float along = d.dot(other.tangent);
      return std::abs(p.tangent.dot(other.tangent)) > 0.99F && std::abs(along) < 0.5F * other.length &&
             (d - along * other.tangent).norm() < 1.5e-3F;
    });
  }
  static std::uint64_t key(const Eigen::Array3d& cell) {
    const auto number = [](double x) { return static_cast<std::uint64_t>(static_cast<std::int64_t>(x)); };
    return mix(number(cell.x()) + mix(number(cell.y()) + mix(number(cell.z()))));
  }
  double cell_m_, reach_m_;
  std::unordered_map<std::uint64_t, std::vector<Known>> cells_;
};

}  // namespace

ContourMap make_contours(const Scene& scene, const RayCaster& rays, double spacing_m, ThreadPool& pool) {
  const MeshEdges edges = find_edges(scene.mesh, kCrease);
  const ContourProber prober(scene, rays, edges);
  const std::vector<Eigen::Vector3d> free_space = free_viewpoints(scene, rays);
  std::vector<std::vector<ContourPoint>> by_chain(edges.chains.size());
  pool.for_chunks(edges.chains.size(), 32, [&](std::size_t, std::size_t begin, std::size_t end) {
    Viewpoints viewpoints(scene.mesh, rays, free_space);
    for (std::size_t i = begin; i < end; ++i)
      by_chain[i] = prober.probe(edges.chains[i], spacing_m, viewpoints);
  });

  ContourMap map;
  DuplicateFilter duplicates(spacing_m);
  std::int32_t contours = 0;
  for (const std::vector<ContourPoint>& chain : by_chain) {
    const std::size_t first = map.points.size();
    std::int32_t in_chain = -1;
    for (const ContourPoint& point : chain) {
      if (duplicates.has(point)) {
        in_chain = -1;
        continue;
      }
      map.points.push_back(point);
      map.points.back().contour = point.contour == in_chain ? contours - 1 : contours++;
      in_chain = point.contour;
    }
    for (std::size_t i = first; i < map.points.size(); ++i) duplicates.add(map.points[i]);
  }
  map.occluders.vertices = scene.mesh.vertices;
  map.occluders.triangles = scene.mesh.triangles;
  return map;
}

}  // namespace evpose::sim
