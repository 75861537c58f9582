// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_build/depth_fusion.h"

#include <algorithm>
#include <cmath>

#include "evpose/core/parallel.h"

namespace evpose::map_build {
namespace {

constexpr double kStepSigma = 4;      // depths of neighbours that differ by more are a step,
constexpr double kSteepest = 5.67;    // unless a surface seen at 80 degrees would differ as much
constexpr double kLeastRayZ = 0.05;   // rays further from the axis tell no depth
constexpr double kReachSigma = 2.5;   // along the ray: one surface
constexpr double kTubeVoxels = 0.75;  // radius around the ray of what is averaged
constexpr double kChosen = 1.5;       // of the sigma: the heaviest voxel is where noise has put most points
constexpr double kLargestReach = 40;  // voxels
constexpr std::int64_t kBias = 1 << 20;  // cells from the origin, each way
constexpr int kBits = 21;

std::uint64_t key_of(const Eigen::Matrix<std::int64_t, 3, 1>& cell) {
  const auto part = [&](int k) { return static_cast<std::uint64_t>(cell[k] + kBias); };
  return (part(0) << (2 * kBits)) | (part(1) << kBits) | part(2);
}

Eigen::Matrix<std::int64_t, 3, 1> cell_of_key(std::uint64_t key) {
  constexpr std::uint64_t kMask = (1 << kBits) - 1;
  const auto part = [&](int shift) { return static_cast<std::int64_t>((key >> shift) & kMask) - kBias; };
  return {part(2 * kBits), part(kBits), part(0)};
}

/// Pixels beside a depth step: 1.
std::vector<std::uint8_t> beside_steps(const DepthImage& image, double focal_px, const DepthNoise& noise) {
  const auto width = static_cast<std::size_t>(image.size.width);
  std::vector<std::uint8_t> out(image.depth.size(), 0);
  const auto compare = [&](std::size_t i, std::size_t k) {
    const std::uint16_t a = image.depth[i], b = image.depth[k];
    if (a == 0 || b == 0) return;
    const double near_m = noise.step_m * std::min(a, b);
    const double step_m = noise.step_m * std::abs(a - b);
    if (step_m > kStepSigma * noise.sigma_m(near_m) + kSteepest * near_m / focal_px) out[i] = out[k] = 1;
  };
  for (std::size_t i = 0; i < image.depth.size(); ++i) {
    if ((i + 1) % width != 0) compare(i, i + 1);
    if (i + width < image.depth.size()) compare(i, i + width);
  }
  return out;
}

}  // namespace

double DepthNoise::sigma_m(double depth_m) const {
  return std::hypot(least_m + growth_per_m * depth_m * depth_m, step_m / std::sqrt(12.0));
}

std::vector<Eigen::Vector3f> rays_of_unit_depth(const Camera& camera) {
  const ImageSize size = camera.size();
  std::vector<Eigen::Vector3f> rays;
  rays.reserve(static_cast<std::size_t>(size.width) * static_cast<std::size_t>(size.height));
  for (int y = 0; y < size.height; ++y)
    for (int x = 0; x < size.width; ++x) {
      const auto ray = camera.unproject({x, y});
      const bool known = ray && ray->z() > kLeastRayZ;
      rays.push_back(known ? Eigen::Vector3f((*ray / ray->z()).cast<float>()) : Eigen::Vector3f::Zero());
    }
  return rays;
}

std::vector<DepthSample> samples_of(const DepthImage& image, std::span<const Eigen::Vector3f> rays,
                                    double focal_px, const DepthFusionConfig& config) {
  EVPOSE_CHECK(image.depth.size() == rays.size());
  const std::vector<std::uint8_t> left_out = beside_steps(image, focal_px, config.noise);
  std::vector<DepthSample> out;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const double depth_m = config.noise.step_m * image.depth[i];
    if (left_out[i] != 0 || depth_m < config.nearest_m || depth_m > config.farthest_m || rays[i].z() == 0)
      continue;
    const auto z = static_cast<float>(depth_m);
    out.push_back({z * rays[i], static_cast<float>(config.noise.sigma_m(depth_m)) * rays[i].norm()});
  }
  return out;
}

DepthFusion::Cell DepthFusion::cell_of(const Eigen::Vector3d& p) const {
  return (p / config_.voxel_m).array().floor().cast<std::int64_t>();
}

Eigen::Vector3d DepthFusion::middle_of(std::uint64_t key) const {
  return config_.voxel_m * (cell_of_key(key).cast<double>().array() + 0.5).matrix();
}

Eigen::Vector3d DepthFusion::mean_of(std::uint64_t key, const Voxel& voxel) const {
  return middle_of(key) + (voxel.offset / voxel.weight).cast<double>();
}

const DepthFusion::Voxel* DepthFusion::find(std::uint64_t key) const {
  const auto found = voxels_.find(key);
  return found == voxels_.end() ? nullptr : &found->second;
}

Status DepthFusion::add(std::span<const DepthSample> samples, const Pose& T_map_cam) {
  const double most_m = static_cast<double>(kBias - 1) * config_.voxel_m - 2 * config_.farthest_m;
  if (!(T_map_cam.p.cwiseAbs().maxCoeff() < most_m))
    return Error{"poses", text("a camera stands more than ", most_m, " m from the origin"),
                 "give poses in a local frame, or larger voxels"};
  eyes_.push_back(T_map_cam.p);
  for (const DepthSample& sample : samples) {
    const Eigen::Vector3d p = T_map_cam * sample.position.cast<double>();
    const Cell cell = cell_of(p);
    if (cell.cwiseAbs().maxCoeff() >= kBias) continue;  // a ray far off the axis
    const std::uint64_t key = key_of(cell);
    Voxel& voxel = voxels_[key];
    const float weight = 1 / (sample.sigma_m * sample.sigma_m);
    voxel.offset += weight * (p - middle_of(key)).cast<float>();
    voxel.ray += weight * (p - T_map_cam.p).normalized().cast<float>();
    voxel.weight += weight;
    ++voxel.count;
  }
  if (voxels_.size() > config_.most_voxels)
    return Error{"depth images", text("their points fill more than ", config_.most_voxels, " voxels"),
                 "give larger voxels, or a shorter range"};
  return {};
}

/// The voxels around the ray through one of them, each visited once: layer by layer across the axis that the
/// ray is nearest to.
class DepthFusion::Column {
 public:
  Column(const DepthFusion& fusion, const Eigen::Vector3d& start, const Voxel& voxel)
      : fusion_(fusion), start_(start), ray_(voxel.ray.cast<double>().normalized()) {
    ray_.cwiseAbs().maxCoeff(&axis_);
    const double sigma_m = std::sqrt(voxel.count / static_cast<double>(voxel.weight));
    reach_m_ = std::min(kReachSigma * sigma_m, kLargestReach * fusion.config_.voxel_m);
  }

  const Eigen::Vector3d& ray() const { return ray_; }
  double reach_m() const { return reach_m_; }

  /// Calls visit(key, voxel, along_m) for those within reach of the place `middle_m` along the ray, up to
  /// `aside` cells beside it, until it returns false.
  template <class Visit>
  bool for_voxels(double middle_m, int aside, const Visit& visit) const {
    const double voxel_m = fusion_.config_.voxel_m, slope = std::abs(ray_[axis_]);
    const int layers = static_cast<int>(std::ceil(reach_m_ * slope / voxel_m));
    const Eigen::Index u = (axis_ + 1) % 3, v = (axis_ + 2) % 3;
    for (int k = -layers; k <= layers; ++k) {
      const Cell at = fusion_.cell_of(start_ + (middle_m + k * voxel_m / slope) * ray_);
      for (int du = -aside; du <= aside; ++du)
        for (int dv = -aside; dv <= aside; ++dv) {
          Cell cell = at;
          cell[u] += du, cell[v] += dv;
          const std::uint64_t key = key_of(cell);
          const Voxel* voxel = fusion_.find(key);
          if (voxel == nullptr) continue;
          const Eigen::Vector3d off = fusion_.mean_of(key, *voxel) - start_;
          const double along_m = ray_.dot(off);
          if (std::abs(along_m - middle_m) > reach_m_) continue;
          if ((off - along_m * ray_).norm() > kTubeVoxels * voxel_m) continue;
          if (!visit(key, *voxel, along_m)) return false;
        }
    }
    return true;
  }

 private:
  const DepthFusion& fusion_;
  Eigen::Vector3d start_, ray_;
  Eigen::Index axis_ = 0;
  double reach_m_ = 0;
};

bool DepthFusion::is_heaviest(std::uint64_t key, const Voxel& voxel) const {
  return Column(*this, mean_of(key, voxel), voxel)
      .for_voxels(0, 0, [&](std::uint64_t other_key, const Voxel& other, double) {
        return other.weight < voxel.weight || (other.weight == voxel.weight && other_key >= key);
      });
}

MeasuredPoint DepthFusion::fused(std::uint64_t key, const Voxel& voxel) const {
  const Eigen::Vector3d start = mean_of(key, voxel);
  const Column column(*this, start, voxel);
  double middle_m = 0, weight = 0, count = 0;
  constexpr int kRounds = 3;  // the first window may reach beyond one end of the surface's noise only
  for (int round = 0; round < kRounds; ++round) {
    double sum = 0;
    weight = count = 0;
    column.for_voxels(middle_m, 1, [&](std::uint64_t, const Voxel& other, double along_m) {
      const auto w = static_cast<double>(other.weight);
      sum += w * along_m, weight += w, count += other.count;
      return true;
    });
    if (weight == 0) break;
    middle_m = sum / weight;
  }
  MeasuredPoint out;
  out.position = start + middle_m * column.ray();
  const double sigma_m = kChosen / std::sqrt(std::max(weight, static_cast<double>(voxel.weight)));
  out.sigma_m = static_cast<float>(std::max(sigma_m, config_.noise.least_m));
  out.observations = static_cast<std::uint32_t>(std::min(count, 4e9));
  return out;
}

std::vector<MeasuredPoint> DepthFusion::points(ThreadPool& pool) const {
  std::vector<std::uint64_t> keys;
  keys.reserve(voxels_.size());
  for (const auto& [key, voxel] : voxels_) keys.push_back(key);
  std::sort(keys.begin(), keys.end());
  constexpr std::size_t kChunk = 4096;
  std::vector<std::vector<MeasuredPoint>> parts(ThreadPool::chunks(keys.size(), kChunk));
  pool.for_chunks(keys.size(), kChunk, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Voxel& voxel = voxels_.at(keys[i]);
      if (is_heaviest(keys[i], voxel)) parts[chunk].push_back(fused(keys[i], voxel));
    }
  });
  std::vector<MeasuredPoint> out;
  for (const auto& part : parts) out.insert(out.end(), part.begin(), part.end());
  return out;
}

std::vector<Eigen::Vector3d> DepthFusion::viewpoints(std::size_t most) const {
  constexpr double kApart_m = 0.3;
  std::vector<Eigen::Vector3d> out;
  if (eyes_.empty()) return out;
  std::vector<double> distance(eyes_.size(), INFINITY);
  std::size_t next = 0;
  while (out.size() < most && (out.empty() || distance[next] > kApart_m)) {
    out.push_back(eyes_[next]);
    for (std::size_t i = 0; i < eyes_.size(); ++i)
      distance[i] = std::min(distance[i], (eyes_[i] - out.back()).norm());
    next = static_cast<std::size_t>(std::max_element(distance.begin(), distance.end()) - distance.begin());
  }
  return out;
}

}  // namespace evpose::map_build
