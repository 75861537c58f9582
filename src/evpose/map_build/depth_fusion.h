// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <unordered_map>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/core/error.h"
#include "evpose/core/pose.h"
#include "evpose/map/measured_point.h"

namespace evpose {
class ThreadPool;
}

namespace evpose::map_build {

/// Error of a depth camera along its optical axis, 1 sigma: triangulated depth errs with its square.
struct DepthNoise {
  double least_m = 0.0015;
  double growth_per_m = 0.0025;  ///< metres for each square metre of depth
  double step_m = 0.001;         ///< that the images' depths are rounded to

  double sigma_m(double depth_m) const;
};

struct DepthFusionConfig {
  DepthNoise noise;
  double nearest_m = 0.1, farthest_m = 5;  ///< depths that are believed
  double voxel_m = 0.01;
  std::size_t most_voxels = 20'000'000;  ///< some 100 bytes each
};

/// Depths along the optical axis, row by row from the top; 0: none.
struct DepthImage {
  ImageSize size;
  std::span<const std::uint16_t> depth;
};

/// The ray of each pixel, as long as to have z = 1; zero where the camera has none.
std::vector<Eigen::Vector3f> rays_of_unit_depth(const Camera& camera);

/// A pixel's point.
struct DepthSample {
  Eigen::Vector3f position;  ///< camera frame, metres
  float sigma_m;             ///< along its ray, 1 sigma
};

/// Of one image whose depths are in units of `config.noise.step_m`. Left out: what is too near or too far,
/// and pixels beside a depth step, which may see both sides (flying pixels). `rays` are those of its camera.
std::vector<DepthSample> samples_of(const DepthImage& image, std::span<const Eigen::Vector3f> rays,
                                    double focal_px, const DepthFusionConfig& config);

/// Puts depth images of known poses together into one cloud. Samples are averaged in each voxel with inverse
/// variances. Where noise is larger than voxels, one surface fills several behind each other: of those on
/// one ray, within its noise, the heaviest stays, at the mean of them all.
class DepthFusion {
 public:
  explicit DepthFusion(const DepthFusionConfig& config) : config_(config) {}

  /// The order of calls matters to the last bits only. Errors: the camera is too far from the origin; more
  /// voxels than `most_voxels`.
  Status add(std::span<const DepthSample> samples, const Pose& T_map_cam);

  std::size_t voxels() const { return voxels_.size(); }
  /// In an order, and with numbers, that are the same for any number of threads. No sigma is less than
  /// `DepthNoise::least_m`, which images share.
  std::vector<MeasuredPoint> points(ThreadPool& pool) const;
  /// At most so many of the places that the camera was at, as far from each other as can be, map frame.
  std::vector<Eigen::Vector3d> viewpoints(std::size_t most) const;

 private:
  using Cell = Eigen::Matrix<std::int64_t, 3, 1>;
  /// Sums over samples, weighted with their inverse variances.
  struct Voxel {
    Eigen::Vector3f offset = Eigen::Vector3f::Zero();  ///< from the voxel's middle
    Eigen::Vector3f ray = Eigen::Vector3f::Zero();     ///< unit vectors from the camera
    float weight = 0;
    std::uint32_t count = 0;
  };
  struct Hash {
    std::size_t operator()(std::uint64_t key) const {
      return static_cast<std::size_t>((key ^ (key >> 29)) * 0x9E3779B97F4A7C15ULL);
    }
  };
  class Column;

  Cell cell_of(const Eigen::Vector3d& p) const;
  Eigen::Vector3d middle_of(std::uint64_t key) const;
  Eigen::Vector3d mean_of(std::uint64_t key, const Voxel& voxel) const;
  const Voxel* find(std::uint64_t key) const;
  bool is_heaviest(std::uint64_t key, const Voxel& voxel) const;
  MeasuredPoint fused(std::uint64_t key, const Voxel& voxel) const;

  DepthFusionConfig config_;
  std::unordered_map<std::uint64_t, Voxel, Hash> voxels_;
  std::vector<Eigen::Vector3d> eyes_;
};

}  // namespace evpose::map_build
