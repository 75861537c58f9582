// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_build/surface_points.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "evpose/core/parallel.h"
#include "evpose/map_build/depth_steps.h"
#include "evpose/map_build/median.h"
#include "evpose/map_build/moments.h"
#include "evpose/map_build/neighbours.h"

namespace evpose::map_build {
namespace {

constexpr std::size_t kSample = 1000;      // points that the scale is measured at
constexpr int kLargestSamplePatch = 1000;  // points
constexpr double kFlat = 0.1;              // thickness^2 over width^2 of a patch that counts as flat
constexpr std::size_t kFewest = 50;        // points of a cloud
constexpr double kLeastNoise_m = 1e-5;     // of any sensor
constexpr double kLayered = 0.1;           // share of patches without any thickness: depth may be rounded
constexpr double kParallelLayers = 0.98;   // mean square of the cosine to their common normal
constexpr std::size_t kNoisePlaces = 9;    // whose median is the local noise

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

/// Where depth is rounded to steps, all that a patch sees of the noise may be one layer: such a place says
/// how far off the next layer is, or nothing. `noise` is that of the patches at `places`.
void measure_steps(const std::vector<Eigen::Vector3f>& points, const Neighbours& tree, std::size_t patch,
                   const std::vector<std::uint32_t>& places, std::vector<double>& noise, CloudScale& scale) {
  std::vector<std::uint32_t> near(patch);
  std::vector<float> squares(patch);
  std::vector<Eigen::Vector3d> around(patch);
  CloudScale told;
  double layered = 0, steps = 0;
  Eigen::Matrix3d normals = Eigen::Matrix3d::Zero();
  for (std::size_t k = 0; k < places.size(); ++k) {
    const Eigen::Vector3f& place = points[places[k]];
    double noise_m = noise[k];
    if (noise_m <= kLeastNoise_m) {
      layered += 1;
      const std::size_t found = tree.nearest(place, near, squares);
      for (std::size_t j = 0; j < found; ++j) around[j] = (points[near[j]] - place).cast<double>();
      const DepthStep step = find_depth_step(std::span(around).first(found), kLeastNoise_m);
      if (step.step_m <= 0) continue;
      noise_m = step.step_m / std::sqrt(12.0);
      normals += step.normal * step.normal.transpose();
      steps += 1;
    }
    told.noise_places.push_back(place);
    told.noise_there_m.push_back(noise_m);
  }
  // Few may be parallel surfaces of a cloud that has no noise.
  if (layered < kLayered * static_cast<double>(places.size()) || steps < kLayered * layered) return;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(normals / steps);
  if (axes.eigenvalues()[2] > kParallelLayers) told.layer_normal = axes.eigenvectors().col(2);
  scale = std::move(told);
  noise = scale.noise_there_m;
}

/// Of each point: the median of the places nearest to it.
std::vector<float> local_noise(const std::vector<Eigen::Vector3f>& points, const CloudScale& scale,
                               ThreadPool& pool) {
  std::vector<float> out;
  if (!scale.layered()) return out;
  out.resize(points.size());
  const Neighbours places(scale.noise_places);
  pool.for_chunks(points.size(), 4096, [&](std::size_t, std::size_t begin, std::size_t end) {
    std::array<std::uint32_t, kNoisePlaces> near{};
    std::array<float, kNoisePlaces> squares{};
    std::vector<double> noise;
    for (std::size_t i = begin; i < end; ++i) {
      const std::size_t found = places.nearest(points[i], near, squares);
      noise.clear();
      for (std::size_t k = 0; k < found; ++k) noise.push_back(scale.noise_there_m[near[k]]);
      out[i] = static_cast<float>(median(noise));
    }
  });
  return out;
}

/// Patches of a cloud in layers. Within a layer no number of points averages its step away: a patch must be
/// wide, and its points are therefore some of all only.
class LayeredPatches {
 public:
  LayeredPatches(const SurfacePoints& surface, const PatchConfig& config) {
    if (surface.noise_m.empty()) return;
    most_ = static_cast<std::size_t>(config.most);
    least_ = static_cast<std::size_t>(config.least);
    for (std::size_t i = 0; i < surface.size(); i += kThinned) some_.push_back(surface.position[i]);
    tree_.emplace(some_);
    squeezed_.reserve(surface.size());
    const CloudScale& scale = surface.scale;
    const double share = std::min(1.0, scale.spacing_m / (std::sqrt(12.0) * scale.noise_m));
    for (const Eigen::Vector3f& p : surface.position) {
      const Eigen::Vector3d n = scale.layer_normal, x = p.cast<double>();
      squeezed_.push_back((x - (1 - share) * n.dot(x) * n).cast<float>());
    }
    squeezed_tree_.emplace(squeezed_);
  }

  /// Nearest first, with the layers moved together: the next point of a surface may lie a step further on.
  std::size_t neighbours(std::size_t i, std::span<std::uint32_t> near, std::span<float> squares) const {
    return squeezed_tree_->nearest(squeezed_[i], near, squares);
  }

  /// Normal, curvature and spacing of point i; the buffers are scratch.
  void describe(std::size_t i, std::vector<std::uint32_t>& near, std::vector<float>& squares,
                SurfacePoints& out) const {
    near.resize(std::max(near.size(), most_)), squares.resize(near.size());
    const std::size_t found = tree_->nearest(out.position[i], std::span(near).first(most_), squares);
    Moments moments;  // relative to the patch's middle point
    const double noise_m = out.noise_at(i);
    for (std::size_t k = 0; k < found; ++k) {
      moments.add((some_[near[k]] - out.position[i]).cast<double>());
      if (k + 1 < found && (k + 1 < least_ || (k + 1) % 8 != 0)) continue;
      const Shape shape = shape_of(moments);
      out.normal[i] = shape.normal.cast<float>();
      const double sum = shape.values.sum();
      out.curvature[i] = sum > 0 ? static_cast<float>(std::max(shape.values[0], 0.0) / sum) : 1.0F / 3;
      out.spacing_m[i] = static_cast<float>(spacing_of(static_cast<double>(squares[k]), kThinned * (k + 1)));
      if (noise_m * noise_m <= kLayerNormal_rad * kLayerNormal_rad * shape.values[1]) break;
    }
  }

 private:
  static constexpr std::size_t kThinned = 8;
  static constexpr double kLayerNormal_rad = 0.1;

  std::size_t most_ = 0, least_ = 0;
  std::vector<Eigen::Vector3f> some_, squeezed_;
  std::optional<Neighbours> tree_, squeezed_tree_;
};

}  // namespace

double SurfacePoints::noise_near(const Neighbours& tree, const Eigen::Vector3d& x) const {
  if (noise_m.empty()) return scale.noise_m;
  std::uint32_t nearest = 0;
  float square = 0;
  const std::size_t found = tree.nearest(x.cast<float>(), std::span(&nearest, 1), std::span(&square, 1));
  return found > 0 ? noise_at(nearest) : scale.noise_m;
}

Expected<CloudScale> measure_scale(const std::vector<Eigen::Vector3f>& points, const Neighbours& tree,
                                   const PatchConfig& config, const std::string& where) {
  if (points.size() < kFewest)
    return Error{where, text("only ", points.size(), " different points"), "give a cloud of surfaces"};
  // The neighbours of a part of the points would lie further apart: the tree holds all.
  const std::size_t patch = std::min<std::size_t>(kLargestSamplePatch, points.size());
  std::vector<std::uint32_t> near(patch);
  std::vector<float> squares(patch);
  std::vector<double> noise, spacing;
  std::vector<std::uint32_t> places;  // of these
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
      places.push_back(static_cast<std::uint32_t>(i));
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
  measure_steps(points, tree, patch, places, noise, scale);
  scale.noise_m = config.noise_m > 0 ? config.noise_m : std::max(median(noise), kLeastNoise_m);
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
  if (!(config.noise_m > 0)) out.noise_m = local_noise(out.position, scale, pool);
  const std::size_t count = out.size();
  out.normal.assign(count, Eigen::Vector3f::Zero());
  out.curvature.assign(count, 1.0F / 3);
  out.spacing_m.assign(count, static_cast<float>(scale.spacing_m));
  out.links.assign(count * SurfacePoints::kLinks, 0);
  const double enough = config.normal_sigma_rad * config.normal_sigma_rad;
  const int most = std::min(config.most, 2 * scale.neighbours);
  const auto usual = static_cast<std::size_t>(std::clamp(
      scale.neighbours * 9 / 8 + 1, SurfacePoints::kLinks + 1, std::max(most, SurfacePoints::kLinks + 1)));
  const LayeredPatches patches(out, config);
  pool.for_chunks(count, 4096, [&](std::size_t, std::size_t begin, std::size_t end) {
    std::vector<std::uint32_t> near(static_cast<std::size_t>(std::max(most, SurfacePoints::kLinks + 1)));
    std::vector<float> squares(near.size());
    for (std::size_t i = begin; i < end; ++i) {
      // Most patches need no more than the typical number.
      const bool layers = !out.noise_m.empty();
      std::size_t found = layers ? patches.neighbours(i, std::span(near).first(usual), squares)
                                 : tree.nearest(out.position[i], std::span(near).first(usual), squares);
      std::uint32_t* links = &out.links[i * SurfacePoints::kLinks];
      int linked = 0;
      for (std::size_t k = 0; k < found && linked < SurfacePoints::kLinks; ++k)
        if (near[k] != i) links[linked++] = near[k];
      while (linked < SurfacePoints::kLinks) links[linked++] = static_cast<std::uint32_t>(i);
      if (layers) {
        patches.describe(i, near, squares, out);
        continue;
      }
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
