// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_build/depth_steps.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <vector>

#include "evpose/map_build/moments.h"

namespace evpose::map_build {
namespace {

constexpr std::size_t kFewestInLayer = 8;  // points that tell a layer's plane
constexpr double kPointsPerLevel = 4;      // fewer off the layer, and they are at all distances

struct Layer {
  Eigen::Vector3d centre, normal;
  double distance(const Eigen::Vector3d& x) const { return normal.dot(x - centre); }
};

/// The plane of the first points, as many as lie in one; false if they lie in none.
bool find_layer(std::span<const Eigen::Vector3d> around, double exact_m, Layer& layer) {
  Moments moments;
  bool found = false;
  for (std::size_t k = 0; k < around.size(); ++k) {
    moments.add(around[k]);
    if (k + 1 < kFewestInLayer || (k + 1) % kFewestInLayer != 0) continue;
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
    solver.computeDirect(moments.covariance());
    const Eigen::Vector3d values = solver.eigenvalues();
    if (values[0] > exact_m * exact_m) break;
    if (values[1] <= 1e-6 * values[2]) continue;  // on a line so far
    layer = {moments.mean(), solver.eigenvectors().col(0)};
    found = true;
  }
  return found;
}

}  // namespace

DepthStep find_depth_step(std::span<const Eigen::Vector3d> around, double exact_m) {
  Layer layer;
  if (!find_layer(around, exact_m, layer)) return {};
  const double apart_m = 10 * exact_m;  // the plane of a small layer may lean a little
  std::vector<double> off;
  for (const Eigen::Vector3d& x : around)
    if (const double d = layer.distance(x); std::abs(d) > apart_m) off.push_back(d);
  if (off.size() < kFewestInLayer) return {};
  std::sort(off.begin(), off.end());
  double nearest = INFINITY, levels = 0;
  for (std::size_t begin = 0, k = 1; k <= off.size(); ++k) {
    if (k < off.size() && off[k] - off[k - 1] <= apart_m) continue;
    levels += 1;
    double sum = 0;
    for (std::size_t j = begin; j < k; ++j) sum += off[j];
    nearest = std::min(nearest, std::abs(sum / static_cast<double>(k - begin)));
    begin = k;
  }
  if (static_cast<double>(off.size()) < kPointsPerLevel * levels) return {};
  return {nearest, layer.normal};
}

}  // namespace evpose::map_build
