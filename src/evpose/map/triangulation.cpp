// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map/triangulation.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <map>

namespace evpose {
namespace {

/// Cuts an area at the heights of all its corners; between two heights it consists of trapezoids.
class Area {
 public:
  explicit Area(const Eigen::Vector3f& normal)
      : first_(normal.unitOrthogonal()), second_(normal.cross(first_)) {}

  void add(const std::vector<Eigen::Vector3f>& ring, const Eigen::Vector3f& origin) {
    for (std::size_t i = 0; i < ring.size(); ++i) {
      const Eigen::Vector2d a = flat(ring[i] - origin), b = flat(ring[(i + 1) % ring.size()] - origin);
      heights_.push_back(a.y());
      if (a.y() < b.y()) sides_.push_back({a, b});
      if (b.y() < a.y()) sides_.push_back({b, a});
    }
  }

  void triangles(const Eigen::Vector3f& origin, TriangleMesh& mesh) {
    std::sort(heights_.begin(), heights_.end());
    heights_.erase(std::unique(heights_.begin(), heights_.end()), heights_.end());
    std::sort(sides_.begin(), sides_.end(),
              [](const Side& a, const Side& b) { return a.low.y() < b.low.y(); });
    std::vector<Side> open;
    std::size_t next = 0;
    for (std::size_t h = 0; h + 1 < heights_.size(); ++h) {
      const double low = heights_[h], high = heights_[h + 1], middle = 0.5 * (low + high);
      std::erase_if(open, [&](const Side& side) { return side.high.y() <= low; });
      for (; next < sides_.size() && sides_[next].low.y() <= low; ++next) open.push_back(sides_[next]);
      std::sort(open.begin(), open.end(),
                [&](const Side& a, const Side& b) { return a.at(middle) < b.at(middle); });
      for (std::size_t k = 0; k + 1 < open.size(); k += 2) {
        const Eigen::Vector2d corners[4] = {{open[k].at(low), low},
                                            {open[k + 1].at(low), low},
                                            {open[k + 1].at(high), high},
                                            {open[k].at(high), high}};
        const auto start = static_cast<std::uint32_t>(mesh.vertices.size());
        for (const auto& c : corners)
          mesh.vertices.emplace_back(origin + static_cast<float>(c.x()) * first_ +
                                     static_cast<float>(c.y()) * second_);
        mesh.triangles.push_back({start, start + 1, start + 2});
        mesh.triangles.push_back({start, start + 2, start + 3});
      }
    }
  }

 private:
  struct Side {
    Eigen::Vector2d low, high;
    double at(double y) const {
      return low.x() + (high.x() - low.x()) * (y - low.y()) / (high.y() - low.y());
    }
  };
  Eigen::Vector2d flat(const Eigen::Vector3f& x) const {
    return {static_cast<double>(first_.dot(x)), static_cast<double>(second_.dot(x))};
  }
  Eigen::Vector3f first_, second_;
  std::vector<Side> sides_;
  std::vector<double> heights_;
};

}  // namespace

TriangleMesh triangulated(const std::vector<MapPlane>& planes, const std::vector<MapPolygon>& polygons) {
  TriangleMesh mesh;
  std::map<std::int32_t, std::vector<const MapPolygon*>> holes;
  for (const MapPolygon& polygon : polygons)
    if (polygon.hole_of >= 0) holes[polygon.hole_of].push_back(&polygon);
  for (std::size_t i = 0; i < polygons.size(); ++i) {
    const MapPolygon& outer = polygons[i];
    if (outer.hole_of >= 0 || outer.vertices.size() < 3) continue;
    Eigen::Vector3f normal = Eigen::Vector3f::Zero();
    const Eigen::Vector3f origin = outer.vertices.front();
    if (outer.plane >= 0 && static_cast<std::size_t>(outer.plane) < planes.size())
      normal = planes[static_cast<std::size_t>(outer.plane)].normal;
    else
      for (std::size_t k = 2; k < outer.vertices.size(); ++k)
        normal += (outer.vertices[k - 1] - origin).cross(outer.vertices[k] - origin);
    if (!(normal.squaredNorm() > 0)) continue;
    Area area(normal.normalized());
    area.add(outer.vertices, origin);
    for (const MapPolygon* hole : holes[static_cast<std::int32_t>(i)]) area.add(hole->vertices, origin);
    area.triangles(origin, mesh);
  }
  return mesh;
}

}  // namespace evpose
