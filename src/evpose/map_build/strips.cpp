// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_build/strips.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "evpose/map_build/neighbours.h"

namespace evpose::map_build {
namespace {

constexpr double kMixed = 2.5;        // noise: so near to the other face a point may be of either
constexpr double kWidthSpacings = 3;  // width of a strip
constexpr double kLeastWidth_m = 0.04;
constexpr double kWindow = 2.5;       // noise: half width of the window that follows the height
constexpr double kFurthest = 4;       // noise: heights that are looked at to begin with
constexpr double kCollected = 8;      // noise: heights that the window may come to and see whole
constexpr double kOffPlane = 0.2;     // share of faces that leave their plane beside an edge
constexpr double kOffPlane_m = 0.02;  // by how much such faces leave their plane, 1 sigma
constexpr double kUneven = 0.1;       // noise: so far a surface may leave its plane unnoticed
constexpr double kSpeaksAgainst = 3;  // sigma: from which on a slope is believed

double width_m(double spacing_m) { return std::max(kLeastWidth_m, kWidthSpacings * spacing_m); }

double mean_in(const std::vector<std::pair<double, double>>& points, double middle, double half, double& rms,
               double& count) {
  double sum = 0, squares = 0;
  count = 0;
  for (const auto& [t, height] : points)
    if (std::abs(height - middle) <= half) sum += height, squares += height * height, count += 1;
  if (count == 0) return middle;
  const double mean = sum / count;
  rms = std::sqrt(std::max(squares / count - mean * mean, 0.0));
  return mean;
}

double density(double x, double variance) {
  return std::exp(-0.5 * x * x / variance) / std::sqrt(2 * std::numbers::pi * variance);
}

/// Slope along the edge and what chunks scatter beyond their noise.
void fit_slope(const std::vector<std::pair<double, double>>& points, double length, double noise_m,
               StripFit& out) {
  constexpr int kChunkPoints = 12, kMostChunks = 64;
  const int chunks = std::clamp(static_cast<int>(points.size()) / kChunkPoints, 1, kMostChunks);
  std::vector<Eigen::Vector3d> sums(static_cast<std::size_t>(chunks), Eigen::Vector3d::Zero());
  for (const auto& [t, height] : points) {
    if (std::abs(height - out.offset_m) > kWindow * noise_m) continue;
    const int j = std::clamp(static_cast<int>((t / length + 0.5) * chunks), 0, chunks - 1);
    sums[static_cast<std::size_t>(j)] += Eigen::Vector3d(1, t, height - out.offset_m);
  }
  Eigen::Matrix2d information = Eigen::Matrix2d::Zero();
  Eigen::Vector2d right = Eigen::Vector2d::Zero();
  for (const auto& s : sums) {
    if (s[0] < 3) continue;
    const Eigen::Vector2d row(1, s[1] / s[0]);
    information += s[0] * row * row.transpose();
    right += s[2] * row;
  }
  const double variance = noise_m * noise_m, determinant = information.determinant();
  if (determinant > 1e-3 * information(0, 0) * information(1, 1)) {
    const double slope = (information.inverse() * right)[1];
    const double slope_variance = variance * information(0, 0) / determinant;
    if (slope * slope > kSpeaksAgainst * kSpeaksAgainst * slope_variance) {
      out.slope = slope;
      out.sigma_m = std::sqrt(out.sigma_m * out.sigma_m + slope_variance * length * length / 12);
    }
  }
  double scatter = 0, expected = 0, used = 0;
  for (const auto& s : sums) {
    if (s[0] < 3) continue;
    scatter += std::pow((s[2] - out.slope * s[1]) / s[0], 2);
    expected += variance / s[0];
    used += 1;
  }
  if (used > 2)
    out.sigma_m = std::sqrt(out.sigma_m * out.sigma_m +
                            std::max(scatter - expected * (used - 2) / used, 0.0) / (used - 2));
}

}  // namespace

double strip_reach_m(double noise_m, double sine, double spacing_m) {
  return kMixed * noise_m / std::max(sine, 0.3) + width_m(spacing_m) + kCollected * noise_m;
}

std::vector<Eigen::Vector3d> points_around(const SurfacePoints& surface, const Neighbours& tree,
                                           const Eigen::Vector3d& begin, const Eigen::Vector3d& end,
                                           double reach_m) {
  std::vector<Eigen::Vector3d> out;
  for_points_along(surface, tree, begin, end, reach_m, [&](std::uint32_t i, const auto&, const auto& off) {
    if (off.norm() <= reach_m) out.push_back(surface.position[i].cast<double>());
  });
  return out;
}

StripFit fit_strip(const std::vector<Eigen::Vector3d>& around, const StripPlace& place, double noise_m) {
  const FittedPlane& plane = place.plane;
  const Eigen::Vector3d middle = 0.5 * (place.begin + place.end);
  const double length = (place.end - place.begin).norm();
  const Eigen::Vector3d along = (place.end - place.begin) / length;
  const double gap = kMixed * noise_m / std::max(place.sine, 0.3);
  const double far = gap + width_m(place.spacing_m);
  std::vector<std::pair<double, double>> points;  // along the edge, height
  for (const Eigen::Vector3d& x : around) {
    const double s = place.inwards.dot(x - middle);
    if (s < gap || s > far) continue;
    if (std::abs(place.other.distance(x)) < kMixed * noise_m) continue;
    const double height = plane.distance(x);
    if (std::abs(height) <= kCollected * noise_m) points.emplace_back(along.dot(x - middle), height);
  }
  const double prior = std::hypot(plane.sigma_at(middle), std::max(kUneven * noise_m, plane.uneven_m));
  StripFit out;
  out.sigma_m = prior;
  double rms = noise_m, count = 0, height = mean_in(points, 0, kFurthest * noise_m, rms, count);
  for (int round = 0; round < 12; ++round) height = mean_in(points, height, kWindow * noise_m, rms, count);
  if (count < 8) {
    out.sigma_m = std::hypot(prior, std::sqrt(kOffPlane) * kOffPlane_m);
    return out;
  }
  const double own = std::max(rms, 0.7 * noise_m) * std::max(rms, 0.7 * noise_m) / count;
  const double in_plane = (1 - kOffPlane) * density(height, own + prior * prior);
  const double off_plane = kOffPlane * density(height, own + kOffPlane_m * kOffPlane_m);
  const double share = off_plane / std::max(in_plane + off_plane, 1e-300);
  // In the plane: both say where it is. Off it: the points alone.
  const double at_plane = height * prior * prior / (own + prior * prior);
  const double at_plane_variance = own * prior * prior / (own + prior * prior);
  out.offset_m = share * height + (1 - share) * at_plane;
  out.sigma_m = std::sqrt(share * own + (1 - share) * at_plane_variance +
                          share * (1 - share) * (height - at_plane) * (height - at_plane));
  fit_slope(points, length, noise_m, out);
  return out;
}

bool stands_before(const Neighbours& tree, const LineSegment& crease, double reach_a_m, double reach_b_m) {
  constexpr int kProbes = 3;
  constexpr double kSteep = 0.3;     // normal's share along z of what stands upright, at most
  constexpr double kBeyond_m = 0.1;  // past the crease's end and beside it, where a wall may go on
  const Eigen::Vector3d along = crease.tangent();
  for (const Eigen::Vector3d& across : {crease.normal_a, crease.normal_b})
    if (std::abs(along.cross(across).z()) > kSteep) return false;
  for (const auto& [across, reach] :
       {std::pair(crease.normal_a, reach_a_m), std::pair(crease.normal_b, reach_b_m)})
    for (const double end : {-1.0, 1.0}) {
      int sides[2] = {0, 0};
      for (int k = 1; k <= kProbes; ++k) {
        const Eigen::Vector3d past = (end > 0 ? crease.end : crease.begin) + end * k * kBeyond_m * along;
        for (const int s : {0, 1})
          sides[s] += tree.any_within(past + (2 * s - 1) * kBeyond_m * across, reach) ? 1 : 0;
      }
      if (std::min(sides[0], sides[1]) == kProbes) return true;
    }
  return false;
}

}  // namespace evpose::map_build
