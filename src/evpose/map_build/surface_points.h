// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "evpose/core/error.h"

namespace evpose {
class ThreadPool;
struct PointCloud;
}  // namespace evpose

namespace evpose::map_build {

class Neighbours;

/// What the cloud is like where it is flat: medians over a sample.
struct CloudScale {
  double spacing_m = 0;  ///< a square of this side holds one point of a surface
  double noise_m = 0;    ///< of a point, across the surface, 1 sigma
  int neighbours = 0;    ///< that a patch needs for its normal to be known to `normal_sigma_rad`
  /// Where depth is rounded to steps that are larger than its noise, the points of a surface lie in layers,
  /// and how thick it is depends on its range: the noise at places all over the cloud (that of a step is its
  /// length over the root of 12). Empty: there are no layers.
  std::vector<Eigen::Vector3f> noise_places{};
  std::vector<double> noise_there_m{};
  /// Of the layers, where they are parallel all over the cloud, as in a single depth image; else zero.
  Eigen::Vector3d layer_normal = Eigen::Vector3d::Zero();

  bool layered() const { return !noise_places.empty(); }
};

/// A cloud's points with what their neighbourhoods say.
struct SurfacePoints {
  static constexpr int kLinks = 12;
  std::vector<Eigen::Vector3f> position;
  std::vector<Eigen::Vector3f> normal;  ///< unit, of either sign; zero where no patch is flat enough
  std::vector<float> curvature;         ///< l0 / (l0 + l1 + l2) of the patch's covariance
  std::vector<float> spacing_m;         ///< local: of the patch
  std::vector<std::uint32_t> links;     ///< the nearest kLinks of each point, nearest first, itself left out
  std::vector<float> noise_m;           ///< local, where points lie in layers; empty: that of the scale
  CloudScale scale;

  std::size_t size() const { return position.size(); }
  double noise_at(std::size_t i) const {
    return noise_m.empty() ? scale.noise_m : static_cast<double>(noise_m[i]);
  }
  /// Of the point nearest to x. `tree` is of the points.
  double noise_near(const Neighbours& tree, const Eigen::Vector3d& x) const;
};

/// The smallest patch in which the direction of a flat surface is known to `normal_sigma_rad`, from the patch
/// itself: noise^2 / (spread^2 count). A fixed number of neighbours on a dense cloud looks at a patch no
/// larger than the noise, where everything looks curved.
struct PatchConfig {
  double normal_sigma_rad = 0.05;
  int least = 12, most = 160;  ///< points of a patch
  /// 1 sigma across surfaces, 0: that of the median patch, which is too little where most points lie on near
  /// ground that is seen askew.
  double noise_m = 0;
};

/// Spacing and noise from patches around a sample of points, each grown until it is flat. Where patches have
/// no thickness at all since depth is rounded, the noise is that of the rounding. Errors: fewer than 50
/// points, or all of them on a line; `where` names the cloud in them.
Expected<CloudScale> measure_scale(const std::vector<Eigen::Vector3f>& points, const Neighbours& tree,
                                   const PatchConfig& config, const std::string& where);

/// Normals and curvatures by principal components of each point's patch (EV-Pose, Map Construction).
/// `tree` is of the points, which are moved, not copied.
SurfacePoints describe_surface(std::vector<Eigen::Vector3f>&& points, const Neighbours& tree,
                               const CloudScale& scale, const PatchConfig& config, ThreadPool& pool);

}  // namespace evpose::map_build
