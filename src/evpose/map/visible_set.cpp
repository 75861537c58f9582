// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map/visible_set.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "evpose/core/config.h"

namespace evpose {
namespace {

constexpr int kBlockCubes = 8;  // a block is 8 x 8 x 8 cubes
constexpr int kDirectionBins = 4;
constexpr double kDepthCell_px = 2;  // of the occluders' depth buffer
constexpr std::uint32_t kNoPoint = 0xFFFFFFFF;

/// A fixed random order of the points: choosing by it spreads points without regard to their order in the file.
std::uint32_t priority_of(std::uint32_t point) {
  std::uint32_t h = point * 0x9E3779B1u;
  h ^= h >> 15;
  h *= 0x85EBCA77u;
  return h ^ (h >> 13);
}

std::int64_t key_of(const Eigen::Vector3f& p, float edge) {
  const auto coordinate = [edge](float v) {
    return static_cast<std::int64_t>(std::clamp(std::floor(v / edge), -1048576.0F, 1048575.0F)) & 0x1FFFFF;
  };
  return (coordinate(p.z()) << 42) | (coordinate(p.y()) << 21) | coordinate(p.x());
}

struct Sphere {
  Eigen::Vector3f centre;
  float radius;
};

template <class Position>
Sphere bound(std::uint32_t begin, std::uint32_t end, const Position& position) {
  Eigen::Vector3f low = position(begin), high = low;
  for (std::uint32_t i = begin; i < end; ++i) {
    low = low.cwiseMin(position(i));
    high = high.cwiseMax(position(i));
  }
  Sphere s{0.5F * (low + high), 0};
  for (std::uint32_t i = begin; i < end; ++i) s.radius = std::max(s.radius, (position(i) - s.centre).norm());
  return s;
}

/// Tangents of the half angles of view, with some room for the margin; at most 75 deg.
Eigen::Vector2d half_view(const Camera& camera) {
  Eigen::Vector2d widest(0.1, 0.1);
  const ImageSize size = camera.size();
  for (double u : {0.0, 0.5, 1.0})
    for (double v : {0.0, 0.5, 1.0}) {
      const auto ray = camera.unproject({u * (size.width - 1), v * (size.height - 1)});
      if (ray && ray->z() > 0.26) widest = widest.cwiseMax((ray->head<2>() / ray->z()).cwiseAbs());
    }
  return 1.05 * widest;
}

}  // namespace

void describe(ConfigTable& table, VisibleSetConfig& c) {
  table.add("far_m", c.far_m, "m", "points further away are left out", {0.1, 1e5});
  table.add("near_m", c.near_m, "m", "points nearer than this are left out", {1e-3, 100});
  table.add("cell_px", c.cell_px, "px", "edge of the image cells over which points are spread", {4, 4096});
  table.add("per_bin", c.per_bin, "", "points per cell and 45 deg of direction", {1, 64});
  table.add("budget", c.budget, "", "most points in all", {6, 100000});
  table.add("margin_px", c.margin_px, "px", "points may lie this far outside of the image when chosen", {0, 1000});
  table.add("refresh_px", c.refresh_px, "px", "points are chosen again when the view has moved by this much", {0, 1000});
  table.add("occlusion", c.occlusion, "leave out points behind the map's occluders, if it has any");
  table.add("grazing_sin", c.grazing_sin, "", "least sine of the angle between contour and line of sight", {0, 1});
}

ContourIndex::ContourIndex(const ContourMap& map, double cube_m) : map_(map), cube_m_(static_cast<float>(cube_m)) {
  const std::size_t n = map.points.size();
  struct Keys {
    std::int64_t block, cube;
  };
  std::vector<Keys> keys(n);
  for (std::size_t i = 0; i < n; ++i) {
    const Eigen::Vector3f& p = map.points[i].position;
    keys[i] = {key_of(p, cube_m_ * kBlockCubes), key_of(p, cube_m_)};
  }
  order_.resize(n);
  std::iota(order_.begin(), order_.end(), 0u);
  std::sort(order_.begin(), order_.end(), [&keys](std::uint32_t a, std::uint32_t b) {
    if (keys[a].block != keys[b].block) return keys[a].block < keys[b].block;
    if (keys[a].cube != keys[b].cube) return keys[a].cube < keys[b].cube;
    return a < b;
  });
  const auto position = [&](std::uint32_t i) -> const Eigen::Vector3f& { return map_.points[order_[i]].position; };
  for (std::uint32_t begin = 0; begin < n;) {
    std::uint32_t block_end = begin;
    while (block_end < n && keys[order_[block_end]].block == keys[order_[begin]].block) ++block_end;
    const Sphere whole = bound(begin, block_end, position);
    const auto first_cube = static_cast<std::uint32_t>(cubes_.size());
    for (std::uint32_t i = begin; i < block_end;) {
      std::uint32_t end = i;
      while (end < block_end && keys[order_[end]].cube == keys[order_[i]].cube) ++end;
      const Sphere s = bound(i, end, position);
      cubes_.push_back({s.centre, s.radius, i, end});
      i = end;
    }
    blocks_.push_back({keys[order_[begin]].block, first_cube, static_cast<std::uint32_t>(cubes_.size()), whole.centre,
                       whole.radius});
    begin = block_end;
  }
}

void ContourIndex::near(const Eigen::Vector3d& centre_map, double radius_m, std::vector<std::uint32_t>& out) const {
  const Eigen::Vector3f centre = (centre_map - map_.anchor).cast<float>();
  const auto radius = static_cast<float>(radius_m);
  // Only the blocks whose keys lie around the sphere are looked up; few enough of them to ask for each.
  const float edge = cube_m_ * kBlockCubes;
  const Eigen::Vector3f low = ((centre.array() - radius) / edge).floor(), high = ((centre.array() + radius) / edge).floor();
  const Eigen::Vector3f count = high - low + Eigen::Vector3f::Ones();
  const auto take = [&](const BlockRange& b) {
    if ((b.centre - centre).norm() > radius + b.radius) return;
    for (std::uint32_t c = b.begin; c < b.end; ++c)
      if ((cubes_[c].centre - centre).norm() <= radius + cubes_[c].radius) out.push_back(c);
  };
  if (count.prod() > static_cast<float>(blocks_.size())) {
    for (const auto& b : blocks_) take(b);
    return;
  }
  const std::size_t first = out.size();
  for (float z = low.z(); z <= high.z(); ++z)
    for (float y = low.y(); y <= high.y(); ++y)
      for (float x = low.x(); x <= high.x(); ++x) {
        const std::int64_t key = key_of(Eigen::Vector3f(x + 0.5F, y + 0.5F, z + 0.5F) * edge, edge);
        const auto it = std::lower_bound(blocks_.begin(), blocks_.end(), key,
                                         [](const BlockRange& b, std::int64_t k) { return b.key < k; });
        if (it != blocks_.end() && it->key == key) take(*it);
      }
  std::sort(out.begin() + static_cast<std::ptrdiff_t>(first), out.end());
}

VisibleSet::VisibleSet(const ContourIndex& index, const Camera& camera, const VisibleSetConfig& config)
    : index_(index), camera_(camera), config_(config), depth_(half_view(camera), kDepthCell_px / camera.focal_px()) {
  // Widest angle of a ray through the image's border, plus the margin.
  double widest = 0;
  const ImageSize size = camera.size();
  for (int i = 0; i <= 16; ++i) {
    const double x = (size.width - 1) * i / 16.0, y = (size.height - 1) * i / 16.0;
    for (const Eigen::Vector2d& pixel : {Eigen::Vector2d(x, 0), Eigen::Vector2d(x, size.height - 1),
                                         Eigen::Vector2d(0, y), Eigen::Vector2d(size.width - 1, y)}) {
      const auto ray = camera.unproject(pixel);
      widest = std::max(widest, ray ? std::acos(std::clamp(ray->z(), -1.0, 1.0)) : camera.valid_angle());
    }
  }
  widest = std::min(widest + config.margin_px / camera.focal_px(), camera.valid_angle());
  cone_cos_ = std::cos(widest);
  cone_sin_ = std::sin(widest);
}

bool VisibleSet::moved(const Pose& T_map_cam) const {
  if (!chosen_once_) return true;
  const Vector6d d = T_map_cam.minus(T_map_cam_);
  const double angle = d.tail<3>().norm() + d.head<3>().norm() / std::max(nearest_m_, config_.near_m);
  return angle * camera_.focal_px() > config_.refresh_px;
}

const std::vector<std::uint32_t>& VisibleSet::choose(const Pose& T_map_cam) {
  if (moved(T_map_cam)) refresh(T_map_cam);
  return points_;
}

void VisibleSet::refresh(const Pose& T_map_cam) {
  T_map_cam_ = T_map_cam;
  chosen_once_ = true;
  candidates_ = 0;
  const ImageSize size = camera_.size();
  const int columns = static_cast<int>(size.width + 2 * config_.margin_px) / config_.cell_px + 1;
  const int rows = static_cast<int>(size.height + 2 * config_.margin_px) / config_.cell_px + 1;
  const auto per_bin = static_cast<std::size_t>(config_.per_bin);
  slots_.assign(static_cast<std::size_t>(columns * rows * kDirectionBins) * per_bin, {0xFFFFFFFF, kNoPoint});

  const bool occlusion = config_.occlusion && !index_.map().occluders.triangles.empty();
  if (occlusion) depth_.render(index_.map(), T_map_cam, config_.near_m);
  near_cubes_.clear();
  index_.near(T_map_cam.p, config_.far_m, near_cubes_);
  const Pose T_cam_map = T_map_cam.inverse();
  const Eigen::Matrix3d R = T_cam_map.rotation();
  const ContourMap& map = index_.map();
  const Eigen::Vector3d offset = R * map.anchor + T_cam_map.p;
  for (const std::uint32_t number : near_cubes_) {
    const auto& cube = index_.cubes()[number];
    const Eigen::Vector3d centre = R * cube.centre.cast<double>() + offset;
    // Distance of the sphere's centre from the cone's surface, positive outside.
    const double across = std::hypot(centre.x(), centre.y());
    if (across * cone_cos_ - centre.z() * cone_sin_ > cube.radius) continue;
    for (std::uint32_t k = cube.begin; k < cube.end; ++k) {
      const std::uint32_t i = index_.order()[k];
      const ContourPoint& point = map.points[i];
      const Eigen::Vector3d x = R * point.position.cast<double>() + offset;
      if (x.z() < config_.near_m || x.squaredNorm() > config_.far_m * config_.far_m) continue;
      Matrix23d jacobian;
      const auto pixel = camera_.project(x, &jacobian);
      if (!pixel || !size.contains(*pixel, -config_.margin_px)) continue;
      const Eigen::Vector3d tangent = R * point.tangent.cast<double>();
      if (tangent.cross(x).squaredNorm() < config_.grazing_sin * config_.grazing_sin * x.squaredNorm()) continue;
      if (occlusion && depth_.hides(x)) continue;
      ++candidates_;
      const Eigen::Vector2d direction = jacobian * tangent;
      double angle = std::atan2(direction.y(), direction.x());
      if (angle < 0) angle += M_PI;
      const int bin = std::min(static_cast<int>(angle * (kDirectionBins / M_PI)), kDirectionBins - 1);
      const int column = static_cast<int>((pixel->x() + config_.margin_px) / config_.cell_px);
      const int row = static_cast<int>((pixel->y() + config_.margin_px) / config_.cell_px);
      Slot* const first = &slots_[static_cast<std::size_t>((row * columns + column) * kDirectionBins + bin) * per_bin];
      Slot candidate{priority_of(i), i};
      for (Slot* s = first; s != first + per_bin; ++s)  // insertion into a short sorted list
        if (candidate.priority < s->priority) std::swap(candidate, *s);
    }
  }
  points_.clear();
  for (const Slot& s : slots_)
    if (s.point != kNoPoint) points_.push_back(s.point);
  if (points_.size() > static_cast<std::size_t>(config_.budget)) {
    const auto middle = points_.begin() + config_.budget;
    std::nth_element(points_.begin(), middle, points_.end(),
                     [](std::uint32_t a, std::uint32_t b) { return priority_of(a) < priority_of(b); });
    points_.erase(middle, points_.end());
    std::sort(points_.begin(), points_.end());
  }
  nearest_m_ = config_.far_m;
  for (const std::uint32_t i : points_)
    nearest_m_ = std::min(nearest_m_, (map.position(i) - T_map_cam.p).norm());
}

}  // namespace evpose
