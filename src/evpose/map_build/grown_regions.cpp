// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_build/grown_regions.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "evpose/core/parallel.h"
#include "evpose/map_build/median.h"
#include "evpose/map_build/moments.h"
#include "evpose/map_build/neighbours.h"

namespace evpose::map_build {
namespace {

// With 30, 0.15 and 0.12 a line lies within 10 mm of 11 % of the shared room's edges instead of 4 %, and the
// regions creep round the edges of a cube under 5 mm of noise.
constexpr std::size_t kNeighbours = 60;  // of a point: a disc of 9 cm radius where points are 2 cm apart
constexpr double kTurn_rad = 0.1;        // most between the normals of neighbours in one region
constexpr float kSmooth = 0.06F;         // curvature of a point from which a region grows on
constexpr std::size_t kFewest = 100;     // points of a region

FittedPlane plane_through(const SurfacePoints& surface, std::vector<std::uint32_t>&& points) {
  FittedPlane plane;
  Moments moments;
  std::vector<float> spacing;
  for (const std::uint32_t i : points) {
    moments.add(surface.position[i].cast<double>());
    spacing.push_back(surface.spacing_m[i]);
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(moments.covariance());
  plane.centre = moments.mean();
  plane.normal = axes.eigenvectors().col(0);
  plane.d = -plane.normal.dot(plane.centre);
  plane.rms_m = std::sqrt(std::max(axes.eigenvalues()[0], 0.0));
  plane.spacing_m = static_cast<double>(median(spacing));
  std::sort(points.begin(), points.end());
  plane.points = std::move(points);
  return plane;
}

/// All points that belong with the seed, which they are labelled with.
std::vector<std::uint32_t> grow(const SurfacePoints& surface, std::uint32_t seed, std::int32_t label,
                                std::vector<std::int32_t>& labels) {
  const auto least_cos = static_cast<float>(std::cos(kTurn_rad));
  std::vector<std::uint32_t> region{seed};
  labels[seed] = label;
  for (std::size_t next = 0; next < region.size(); ++next) {
    const std::uint32_t at = region[next];
    if (surface.curvature[at] > kSmooth) continue;
    for (int k = 0; k < SurfacePoints::kLinks; ++k) {
      const std::uint32_t q =
          surface.links[static_cast<std::size_t>(at) * SurfacePoints::kLinks + static_cast<std::size_t>(k)];
      if (labels[q] != -1 || std::abs(surface.normal[q].dot(surface.normal[at])) < least_cos) continue;
      labels[q] = label;
      region.push_back(q);
    }
  }
  return region;
}

}  // namespace

SurfacePoints describe_by_neighbours(std::vector<Eigen::Vector3f>&& points, const Neighbours& tree,
                                     const CloudScale& scale, ThreadPool& pool) {
  SurfacePoints out;
  out.position = std::move(points);
  out.scale = scale;
  out.scale.neighbours = kNeighbours;
  const std::size_t count = out.size();
  out.normal.assign(count, Eigen::Vector3f::Zero());
  out.curvature.assign(count, 1.0F / 3);
  out.spacing_m.assign(count, static_cast<float>(scale.spacing_m));
  out.links.assign(count * SurfacePoints::kLinks, 0);
  pool.for_chunks(count, 4096, [&](std::size_t, std::size_t begin, std::size_t end) {
    std::vector<std::uint32_t> near(kNeighbours);
    std::vector<float> squares(kNeighbours);
    for (std::size_t i = begin; i < end; ++i) {
      const std::size_t found = tree.nearest(out.position[i], near, squares);
      Moments moments;  // relative to the point
      for (std::size_t k = 0; k < found; ++k)
        moments.add((out.position[near[k]] - out.position[i]).cast<double>());
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes;
      axes.computeDirect(moments.covariance());
      out.normal[i] = axes.eigenvectors().col(0).cast<float>();
      if (const double sum = axes.eigenvalues().sum(); sum > 0)
        out.curvature[i] = static_cast<float>(std::max(axes.eigenvalues()[0], 0.0) / sum);
      out.spacing_m[i] = static_cast<float>(
          std::sqrt(std::numbers::pi * static_cast<double>(squares[found - 1]) / static_cast<double>(found)));
      // The point itself is the first, but for points at the same place.
      for (std::size_t k = 0; k < SurfacePoints::kLinks; ++k)
        out.links[i * SurfacePoints::kLinks + k] = near[std::min(k + 1, found - 1)];
    }
  });
  return out;
}

Planes grow_regions(const SurfacePoints& surface) {
  Planes out;
  out.label.assign(surface.size(), -1);
  std::vector<std::uint32_t> order(surface.size());
  std::iota(order.begin(), order.end(), 0U);
  std::stable_sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return surface.curvature[a] < surface.curvature[b];
  });
  constexpr std::int32_t kTooSmall = -2;  // for a plane; nothing grows over it again
  for (const std::uint32_t seed : order) {
    if (out.label[seed] != -1 || surface.curvature[seed] > kSmooth) continue;
    const auto number = static_cast<std::int32_t>(out.planes.size());
    std::vector<std::uint32_t> region = grow(surface, seed, number, out.label);
    if (region.size() < kFewest)
      for (const std::uint32_t i : region) out.label[i] = kTooSmall;
    else
      out.planes.push_back(plane_through(surface, std::move(region)));
  }
  for (std::int32_t& label : out.label) label = std::max(label, -1);
  return out;
}

}  // namespace evpose::map_build
