// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/maps/contour_completion.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

#include "evpose/core/log.h"
#include "evpose/io/maps/point_grid.h"

namespace evpose {
namespace {

constexpr float kLikeNormal = 0.9F;  // cosine
constexpr float kAside = 0.3F;       // of the distance: what still counts as along the contour
constexpr float kSamePlace = 1e-6F;  // m
/// In spacings, and how many points within it are looked at. The second: where points are sparser than usual;
/// the third: where contours are bands of points, merged from many frames.
struct Reach {
  float spacings;
  std::size_t neighbours;
};
constexpr Reach kReaches[] = {{5, 12}, {20, 12}, {50, 160}};

struct Neighbour {
  float distance;
  std::uint32_t index;
  bool operator<(const Neighbour& other) const {
    return distance < other.distance || (distance == other.distance && index < other.index);
  }
};

/// Whether two points may be of one contour, as far as their own entries tell.
bool akin(const ContourPoint& a, const ContourPoint& b) {
  if (a.contour != b.contour) return false;
  if (a.contour >= 0) return true;
  if (a.plane_a != b.plane_a) return false;
  return a.normal.isZero() || b.normal.isZero() || a.normal.dot(b.normal) > kLikeNormal;
}

class Neighbourhood {
 public:
  Neighbourhood(const ContourMap& map, const std::vector<Eigen::Vector3f>& positions, const Reach& reach,
                float spacing)
      : map_(map),
        grid_(positions, reach.spacings * spacing),
        reach_(reach.spacings * spacing),
        most_(reach.neighbours) {}

  /// The nearest akin points, not at the same place.
  const std::vector<Neighbour>& of(std::size_t i) {
    found_.clear();
    const ContourPoint& p = map_.points[i];
    grid_.for_candidates(p.position, [&](std::uint32_t j) {
      const float d = (map_.points[j].position - p.position).norm();
      if (d > kSamePlace && d <= reach_ && akin(p, map_.points[j])) found_.push_back({d, j});
    });
    const std::size_t count = std::min(most_, found_.size());
    std::partial_sort(found_.begin(), found_.begin() + static_cast<std::ptrdiff_t>(count), found_.end());
    found_.resize(count);
    return found_;
  }

 private:
  const ContourMap& map_;
  PointGrid grid_;
  float reach_;
  std::size_t most_;
  std::vector<Neighbour> found_;
};

/// Main direction of the offsets, those far aside of `along` left out unless it is zero.
Eigen::Vector3f main_direction(const std::vector<Eigen::Vector3f>& offsets, const Eigen::Vector3f& along) {
  Eigen::Matrix3f scatter = Eigen::Matrix3f::Zero();
  for (const auto& d : offsets) {
    const float aside = (d - d.dot(along) * along).norm();
    if (along.isZero() || aside < kAside * d.norm()) scatter += d.normalized() * d.normalized().transpose();
  }
  if (scatter.isZero()) return Eigen::Vector3f::Zero();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3f> solver(scatter);
  // Clearly a line, not a patch.
  if (solver.eigenvalues()[2] < 2 * solver.eigenvalues()[1]) return Eigen::Vector3f::Zero();
  return solver.eigenvectors().col(2);
}

Eigen::Vector3f estimate_tangent(const ContourMap& map, std::size_t i,
                                 const std::vector<Neighbour>& neighbours) {
  const ContourPoint& p = map.points[i];
  std::vector<Eigen::Vector3f> offsets;
  for (const auto& neighbour : neighbours) {
    Eigen::Vector3f d = map.points[neighbour.index].position - p.position;
    d -= d.dot(p.normal) * p.normal;
    // What is left of an offset mostly along the normal says nothing about the contour.
    if (d.norm() > 0.5F * neighbour.distance) offsets.push_back(d);
  }
  const Eigen::Vector3f first = main_direction(offsets, Eigen::Vector3f::Zero());
  Eigen::Vector3f tangent = main_direction(offsets, first);
  if (tangent.isZero()) return tangent;
  // A sign that does not depend on the solver's.
  Eigen::Index largest = 0;
  tangent.cwiseAbs().maxCoeff(&largest);
  return tangent[largest] < 0 ? Eigen::Vector3f(-tangent) : tangent;
}

/// Half-way to the nearest neighbour on each side; 0 when there is none.
float estimate_length(const ContourMap& map, std::size_t i, const std::vector<Neighbour>& neighbours) {
  const ContourPoint& p = map.points[i];
  float before = std::numeric_limits<float>::max(), after = before;
  for (const auto& neighbour : neighbours) {
    const Eigen::Vector3f d = map.points[neighbour.index].position - p.position;
    const float along = d.dot(p.tangent);
    if ((d - along * p.tangent).norm() > kAside * neighbour.distance) continue;
    float& side = along < 0 ? before : after;
    side = std::min(side, std::abs(along));
  }
  float length = 0;
  for (const float side : {before, after})
    if (side < std::numeric_limits<float>::max()) length += side / 2;
  return length;
}

/// Counts what had to be put right.
struct Corrections {
  std::size_t not_unit = 0, not_perpendicular = 0;
};

void make_unit(Eigen::Vector3f& v, Corrections& corrections) {
  const double norm = v.cast<double>().norm();
  if (norm < 1e-6) {
    v.setZero();
    return;
  }
  if (std::abs(norm - 1) > 1e-3) ++corrections.not_unit;
  v = (v.cast<double>() / norm).cast<float>();
}

void make_perpendicular(ContourPoint& p, Corrections& corrections) {
  if (p.normal.isZero() || p.tangent.isZero()) return;
  const float dot = p.normal.dot(p.tangent);
  if (std::abs(dot) > 1e-2F) ++corrections.not_perpendicular;
  p.normal -= dot * p.tangent;
  const float norm = p.normal.norm();
  if (norm < 0.1F) {
    p.normal.setZero();  // along the contour: no normal at all
  } else {
    p.normal /= norm;
  }
}

std::size_t fill_tangents(ContourMap& map, const std::vector<Eigen::Vector3f>& positions, float spacing) {
  std::vector<std::size_t> missing;
  for (std::size_t i = 0; i < map.points.size(); ++i)
    if (map.points[i].tangent.isZero()) missing.push_back(i);
  for (const Reach& reach : kReaches) {
    if (missing.empty() || spacing <= 0) break;
    Neighbourhood neighbourhood(map, positions, reach, spacing);
    std::erase_if(missing, [&](std::size_t i) {
      map.points[i].tangent = estimate_tangent(map, i, neighbourhood.of(i));
      return !map.points[i].tangent.isZero();
    });
  }
  return missing.size();
}

void fill_lengths(ContourMap& map, const std::vector<Eigen::Vector3f>& positions, float spacing) {
  std::vector<std::size_t> missing;
  for (std::size_t i = 0; i < map.points.size(); ++i)
    if (map.points[i].length == 0 && !map.points[i].tangent.isZero()) missing.push_back(i);
  for (const Reach& reach : kReaches) {
    if (missing.empty() || spacing <= 0) break;
    Neighbourhood neighbourhood(map, positions, reach, spacing);
    std::erase_if(missing, [&](std::size_t i) {
      map.points[i].length = estimate_length(map, i, neighbourhood.of(i));
      return map.points[i].length > 0;
    });
  }
  for (const std::size_t i : missing) map.points[i].length = spacing;
}

}  // namespace

Status complete_contours(ContourMap& map) {
  if (map.points.empty())
    return Error{map.source, "the map is empty: no contour points", "build or export it again"};
  Corrections corrections;
  std::vector<Eigen::Vector3f> positions;
  bool complete = true;
  for (ContourPoint& p : map.points) {
    make_unit(p.normal, corrections);
    make_unit(p.tangent, corrections);
    make_perpendicular(p, corrections);
    positions.push_back(p.position);
    complete &= !p.tangent.isZero() && p.length > 0;
  }
  if (corrections.not_unit + corrections.not_perpendicular > 0)
    log_warning(text(map.source, ": ", corrections.not_unit, " normals or tangents were not of unit length, ",
                     corrections.not_perpendicular, " not perpendicular to each other: put right"));
  if (complete) return {};
  // Cubes of less than a tenth of a millimetre would leave the range of their keys.
  const float measured = typical_spacing(positions);
  const float spacing = measured > 0 ? std::max(measured, 1e-4F) : 0;
  const std::size_t without = fill_tangents(map, positions, spacing);
  const std::size_t all = map.points.size();
  if (2 * without > all)
    return Error{map.source,
                 text(without, " of ", all, " points have no neighbours along a contour (typical distance ",
                      spacing, " m)"),
                 "give a map of contour points; of a cloud of surfaces `evpose map build` makes one"};
  fill_lengths(map, positions, spacing);
  if (without > 0) {
    std::erase_if(map.points, [](const ContourPoint& p) { return p.tangent.isZero(); });
    map.pages.clear();
    log_warning(
        text(map.source, ": ", without, " of ", all, " points have no neighbours along a contour: left out"));
  }
  return {};
}

}  // namespace evpose
