// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_build/surface_points.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "evpose/core/parallel.h"
#include "evpose/map_build/median.h"
#include "evpose/map_build/moments.h"
#include "evpose/map_build/neighbours.h"

namespace evpose::map_build {
namespace {

constexpr std::size_t kSample = 1000;      // points that the scale is measured at
constexpr int kLargestSamplePatch = 1000;  // points
constexpr double kFlat = 0.1;              // thickness^2 over width^2 of a patch that counts as flat
constexpr std::size_t kFewest = 50;        // points of a cloud

struct Shape {
  Eigen::Vector3d values = Eigen::Vector3d::Zero();  ///< ascending
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  /// Square of the normal's error if what makes the patch thick is noise.
  double normal_variance(double count) const {
    return values[1] > 0 ? std::max(values[0], 0.0) / (values[1] * count) : 1;
  }
};

Shape shape_of(const Moments& moments) {
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
  solver.computeDirect(moments.covariance());
  return {solver.eigenvalues(), solver.eigenvectors().col(0)};
}

double spacing_of(double radius_squared, std::size_t count) {
  return std::sqrt(std::numbers::pi * radius_squared / static_cast<double>(count));
}

}  // namespace

Expected<CloudScale> measure_scale(const std::vector<Eigen::Vector3f>& points, const Neighbours& tree,
                                   const PatchConfig& config, const std::string& where) {
  if (points.size() < kFewest)
    return Error{where, text("only ", points.size(), " different points"), "give a cloud of surfaces"};
  // The neighbours of a part of the points would lie further apart: the tree holds all.
  const std::size_t patch = std::min<std::size_t>(kLargestSamplePatch, points.size());
  std::vector<std::uint32_t> near(patch);
  std::vector<float> squares(patch);
  std::vector<double> noise, spacing;
  std::size_t on_a_line = 0, looked = 0;
  const std::size_t step = std::max<std::size_t>(1, points.size() / kSample);
  for (std::size_t i = 0; i < points.size(); i += step, ++looked) {
    const std::size_t found = tree.nearest(points[i], near, squares);
    Moments moments;  // relative to the patch's middle point
    bool line = true;
    for (std::size_t k = 0; k < found; ++k) {
      moments.add((points[near[k]] - points[i]).cast<double>());
      const auto count = static_cast<int>(k + 1);
      if (count < config.least || (count % 8 != 0 && k + 1 < found)) continue;
      const Shape shape = shape_of(moments);
      line = line && !(shape.values[1] > 1e-6 * shape.values[2]);
      if (shape.values[0] > kFlat * shape.values[1]) continue;
      // Flat by chance while it is smaller than the noise: twice as large it must be flat still, so go on
      // from here until the normal is known.
      if (shape.normal_variance(count) > config.normal_sigma_rad * config.normal_sigma_rad) continue;
      if (line) continue;
      noise.push_back(std::sqrt(std::max(shape.values[0], 0.0) * count / (count - 3.0)));
      spacing.push_back(spacing_of(static_cast<double>(squares[k]), k + 1));
      break;
    }
    on_a_line += line ? 1 : 0;
  }
  if (2 * on_a_line > looked)
    return Error{where, "the points lie on lines, not on surfaces (or most are duplicates)",
                 "give a cloud of surfaces"};
  if (noise.size() * 20 < looked)
    return Error{where,
                 text("no surface is flat: only ", noise.size(), " of ", looked, " patches of up to ", patch,
                      " points; too sparse, or too noisy"),
                 "give a denser cloud"};
  CloudScale scale;
  scale.noise_m = config.noise_m > 0 ? config.noise_m : std::max(median(noise), 1e-5);
  scale.spacing_m = std::max(median(spacing), 1e-5);
  // A disc of k points has the radius spacing sqrt(k / pi), a spread of half of it, and therefore a normal
  // known to 2 sqrt(pi) noise / (spacing k).
  const double k =
      2 * std::sqrt(std::numbers::pi) * scale.noise_m / (scale.spacing_m * config.normal_sigma_rad);
  scale.neighbours = std::clamp(static_cast<int>(std::ceil(k)), config.least, config.most);
  return scale;
}

SurfacePoints describe_surface(std::vector<Eigen::Vector3f>&& points, const Neighbours& tree,
                               const CloudScale& scale, const PatchConfig& config, ThreadPool& pool) {
  SurfacePoints out;
  out.position = std::move(points);
  out.scale = scale;
  const std::size_t count = out.size();
  out.normal.assign(count, Eigen::Vector3f::Zero());
  out.curvature.assign(count, 1.0F / 3);
  out.spacing_m.assign(count, static_cast<float>(scale.spacing_m));
  out.links.assign(count * SurfacePoints::kLinks, 0);
  const double enough = config.normal_sigma_rad * config.normal_sigma_rad;
  const int most = std::min(config.most, 2 * scale.neighbours);
  const auto usual = static_cast<std::size_t>(std::clamp(
      scale.neighbours * 9 / 8 + 1, SurfacePoints::kLinks + 1, std::max(most, SurfacePoints::kLinks + 1)));
  pool.for_chunks(count, 4096, [&](std::size_t, std::size_t begin, std::size_t end) {
    std::vector<std::uint32_t> near(static_cast<std::size_t>(std::max(most, SurfacePoints::kLinks + 1)));
    std::vector<float> squares(near.size());
    for (std::size_t i = begin; i < end; ++i) {
      // Most patches need no more than the typical number.
      std::size_t found = tree.nearest(out.position[i], std::span(near).first(usual), squares);
      std::uint32_t* links = &out.links[i * SurfacePoints::kLinks];
      int linked = 0;
      for (std::size_t k = 0; k < found && linked < SurfacePoints::kLinks; ++k)
        if (near[k] != i) links[linked++] = near[k];
      while (linked < SurfacePoints::kLinks) links[linked++] = static_cast<std::uint32_t>(i);
      Moments moments;  // relative to the patch's middle point
      int next = std::max(config.least, scale.neighbours / 2);
      for (std::size_t k = 0; k < found; ++k) {
        if (k + 1 == usual && found == usual && near.size() > usual)
          found = tree.nearest(out.position[i], near, squares);
        moments.add((out.position[near[k]] - out.position[i]).cast<double>());
        if (moments.count < next && k + 1 < found) continue;
        const Shape shape = shape_of(moments);
        out.normal[i] = shape.normal.cast<float>();
        const double sum = shape.values.sum();
        out.curvature[i] = sum > 0 ? static_cast<float>(std::max(shape.values[0], 0.0) / sum) : 1.0F / 3;
        out.spacing_m[i] = static_cast<float>(spacing_of(static_cast<double>(squares[k]), k + 1));
        if (shape.normal_variance(moments.count) <= enough) break;
        next = static_cast<int>(moments.count) * 3 / 2;
      }
    }
  });
  return out;
}

}  // namespace evpose::map_build
