// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map/depth_buffer.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace evpose {
namespace {
// A surface hides a point if it is nearer by this length plus this share of the depth.
constexpr float kSlack_m = 0.01F;
constexpr float kSlackShare = 0.002F;
// In the cells around it, a surface hides a point if it is nearer by this share: a silhouette close by.
constexpr float kSilhouetteShare = 0.10F;
}  // namespace

DepthBuffer::DepthBuffer(const Eigen::Vector2d& tangents, double cell)
    : tangents_(tangents.cast<float>()),
      cell_(static_cast<float>(cell)),
      columns_(static_cast<int>(2 * tangents.x() / cell) + 1),
      rows_(static_cast<int>(2 * tangents.y() / cell) + 1) {
  inverse_depths_.resize(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_));
  surfaces_.resize(inverse_depths_.size());
}

void DepthBuffer::reset_view(const ContourMap& map, const Pose& T_map_cam, double near_m) {
  std::fill(inverse_depths_.begin(), inverse_depths_.end(), 0.0F);
  slopes_.clear();
  triangles_.clear();
  const Pose T_cam_map = T_map_cam.inverse();
  R_cam_map_ = T_cam_map.rotation().cast<float>();
  offset_ = (T_cam_map * map.anchor).cast<float>();
  near_m_ = static_cast<float>(near_m);
}

std::size_t DepthBuffer::draw(const ContourMap& map, std::span<const std::uint32_t> triangles) {
  std::size_t filled = 0;
  const TriangleMesh& mesh = map.occluders;
  for (const std::uint32_t number : triangles) {
    Eigen::Vector3f corners[3];
    for (std::size_t k = 0; k < 3; ++k)
      corners[k] = R_cam_map_ * mesh.vertices[mesh.triangles[number][k]] + offset_;
    filled += clip_and_draw(corners);
    triangles_.resize(slopes_.size(), number);
  }
  return filled;
}

void DepthBuffer::render(const ContourMap& map, const Pose& T_map_cam, double near_m) {
  reset_view(map, T_map_cam, near_m);
  std::vector<std::uint32_t> all(map.occluders.triangles.size());
  std::iota(all.begin(), all.end(), 0u);
  draw(map, all);
}

std::size_t DepthBuffer::clip_and_draw(const Eigen::Vector3f* corners) {
  Eigen::Vector3f kept[4];
  int n = 0;
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3f& a = corners[i];
    const Eigen::Vector3f& b = corners[(i + 1) % 3];
    if (a.z() >= near_m_) kept[n++] = a;
    if ((a.z() >= near_m_) != (b.z() >= near_m_))
      kept[n++] = a + (near_m_ - a.z()) / (b.z() - a.z()) * (b - a);
  }
  if (n < 3) return 0;
  // The plane n.x = d gives 1 / z = n.(x / z, y / z, 1) / d; planes through the eye are seen edge-on.
  const Eigen::Vector3f normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalized();
  const float distance = normal.dot(corners[0]);
  if (!(std::abs(distance) > 1e-4F)) return 0;
  std::size_t filled = 0;
  for (int i = 2; i < n; ++i) filled += draw(kept[0], kept[i - 1], kept[i], normal / distance);
  return filled;
}

std::size_t DepthBuffer::draw(Eigen::Vector3f a, Eigen::Vector3f b, Eigen::Vector3f c,
                              const Eigen::Vector3f& slope) {
  const auto surface = static_cast<std::uint32_t>(slopes_.size());
  slopes_.push_back(slope);
  std::size_t filled = 0;
  // To grid coordinates (cell centres at whole numbers); 1 / z is linear over the grid.
  for (Eigen::Vector3f* v : {&a, &b, &c}) {
    const float w = 1 / v->z();
    *v = {(v->x() * w + tangents_.x()) / cell_ - 0.5F, (v->y() * w + tangents_.y()) / cell_ - 0.5F, w};
  }
  if (a.y() > b.y()) std::swap(a, b);
  if (b.y() > c.y()) std::swap(b, c);
  if (a.y() > b.y()) std::swap(a, b);
  const float first_row = std::max(std::ceil(a.y()), 0.0F),
              last_row = std::min(std::floor(c.y()), static_cast<float>(rows_ - 1));
  for (float y = first_row; y <= last_row; ++y) {
    const auto cross = [y](const Eigen::Vector3f& p, const Eigen::Vector3f& q) {
      return p.x() + (q.x() - p.x()) * (y - p.y()) / (q.y() - p.y());
    };
    float left = cross(a, c);
    float right = (y < b.y() || b.y() == c.y()) ? cross(a, b) : cross(b, c);
    if (a.y() == b.y() && y <= b.y()) right = b.x();
    if (left > right) std::swap(left, right);
    const float x0 = std::max(std::ceil(left), 0.0F),
                x1 = std::min(std::floor(right), static_cast<float>(columns_ - 1));
    if (!(x0 <= x1)) continue;
    const float v = (y + 0.5F) * cell_ - tangents_.y();
    const float step = slope.x() * cell_,
                first = slope.x() * ((x0 + 0.5F) * cell_ - tangents_.x()) + slope.y() * v + slope.z();
    const std::size_t at =
        static_cast<std::size_t>(y) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(x0);
    float* const depth = inverse_depths_.data() + at;
    std::uint32_t* const owner = surfaces_.data() + at;
    const int count = static_cast<int>(x1 - x0) + 1;
    for (int k = 0; k < count; ++k) {
      const float w = first + step * static_cast<float>(k);
      const bool nearer = w > depth[k];
      depth[k] = nearer ? w : depth[k];
      owner[k] = nearer ? surface : owner[k];
    }
    filled += static_cast<std::size_t>(count);
  }
  return filled;
}

bool DepthBuffer::hides(const Eigen::Vector3d& point_cam) const {
  const auto z = static_cast<float>(point_cam.z());
  const Eigen::Vector3f ray = (point_cam / point_cam.z()).cast<float>();
  const float x = (ray.x() + tangents_.x()) / cell_ - 0.5F, y = (ray.y() + tangents_.y()) / cell_ - 0.5F;
  const int column = static_cast<int>(std::floor(x)), row = static_cast<int>(std::floor(y));
  // The four cells around the point are asked at the point itself, those further out for silhouettes.
  for (int r = std::max(row - 1, 0); r <= std::min(row + 2, rows_ - 1); ++r)
    for (int c = std::max(column - 1, 0); c <= std::min(column + 2, columns_ - 1); ++c) {
      const std::size_t at =
          static_cast<std::size_t>(r) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(c);
      if (!(inverse_depths_[at] > 0)) continue;
      if (inverse_depths_[at] * (z - kSilhouetteShare * z) > 1) return true;
      const bool around = r >= row && r <= row + 1 && c >= column && c <= column + 1;
      if (around && slopes_[surfaces_[at]].dot(ray) * (z - kSlack_m - kSlackShare * z) > 1) return true;
    }
  return false;
}

/// The cell that holds this direction, if a surface is seen in it.
std::optional<std::size_t> DepthBuffer::cell_at(const Eigen::Vector2f& tangents) const {
  const auto column = static_cast<int>(std::floor((tangents.x() + tangents_.x()) / cell_));
  const auto row = static_cast<int>(std::floor((tangents.y() + tangents_.y()) / cell_));
  if (column < 0 || row < 0 || column >= columns_ || row >= rows_) return std::nullopt;
  const std::size_t at =
      static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(column);
  if (!(inverse_depths_[at] > 0)) return std::nullopt;
  return at;
}

std::optional<std::uint32_t> DepthBuffer::triangle_at(const Eigen::Vector2f& tangents) const {
  const auto at = cell_at(tangents);
  if (!at) return std::nullopt;
  return triangles_[surfaces_[*at]];
}

std::optional<double> DepthBuffer::depth_at(const Eigen::Vector2f& tangents) const {
  const auto at = cell_at(tangents);
  if (!at) return std::nullopt;
  const float inverse = slopes_[surfaces_[*at]].dot(tangents.homogeneous());
  if (!(inverse > 0)) return std::nullopt;
  return 1 / static_cast<double>(inverse);
}

}  // namespace evpose
