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
// ... and, in the cells around, by this share: a silhouette close by.
constexpr float kSilhouetteShare = 0.10F;
}  // namespace

DepthBuffer::DepthBuffer(const Eigen::Vector2d& tangents, double cell)
    : tangents_(tangents.cast<float>()),
      cell_(static_cast<float>(cell)),
      columns_(static_cast<int>(2 * tangents.x() / cell) + 1),
      rows_(static_cast<int>(2 * tangents.y() / cell) + 1) {
  cells_.resize(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_));
}

void DepthBuffer::start(const ContourMap& map, const Pose& T_map_cam, double near_m) {
  std::fill(cells_.begin(), cells_.end(), Cell{0, Eigen::Vector3f::Zero()});
  const Pose T_cam_map = T_map_cam.inverse();
  R_cam_map_ = T_cam_map.rotation().cast<float>();
  offset_ = (T_cam_map * map.anchor).cast<float>();
  near_m_ = static_cast<float>(near_m);
}

void DepthBuffer::draw(const ContourMap& map, std::span<const std::uint32_t> triangles) {
  const TriangleMesh& mesh = map.occluders;
  for (const std::uint32_t number : triangles) {
    Eigen::Vector3f corners[3];
    for (std::size_t k = 0; k < 3; ++k)
      corners[k] = R_cam_map_ * mesh.vertices[mesh.triangles[number][k]] + offset_;
    clip_and_draw(corners);
  }
}

void DepthBuffer::render(const ContourMap& map, const Pose& T_map_cam, double near_m) {
  start(map, T_map_cam, near_m);
  std::vector<std::uint32_t> all(map.occluders.triangles.size());
  std::iota(all.begin(), all.end(), 0u);
  draw(map, all);
}

void DepthBuffer::clip_and_draw(const Eigen::Vector3f* corners) {
  Eigen::Vector3f kept[4];
  int n = 0;
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3f& a = corners[i];
    const Eigen::Vector3f& b = corners[(i + 1) % 3];
    if (a.z() >= near_m_) kept[n++] = a;
    if ((a.z() >= near_m_) != (b.z() >= near_m_))
      kept[n++] = a + (near_m_ - a.z()) / (b.z() - a.z()) * (b - a);
  }
  if (n < 3) return;
  // The plane n.x = d gives 1 / z = n.(x / z, y / z, 1) / d; planes through the eye are seen edge-on.
  const Eigen::Vector3f normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalized();
  const float distance = normal.dot(corners[0]);
  if (!(std::abs(distance) > 1e-4F)) return;
  for (int i = 2; i < n; ++i) draw(kept[0], kept[i - 1], kept[i], normal / distance);
}

void DepthBuffer::draw(Eigen::Vector3f a, Eigen::Vector3f b, Eigen::Vector3f c,
                       const Eigen::Vector3f& slope) {
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
    const float v = (y + 0.5F) * cell_ - tangents_.y(), row_part = slope.y() * v + slope.z();
    Cell* cell = &cells_[static_cast<std::size_t>(y) * static_cast<std::size_t>(columns_) +
                         static_cast<std::size_t>(x0)];
    for (float x = x0; x <= x1; ++x, ++cell) {
      const float w = slope.x() * ((x + 0.5F) * cell_ - tangents_.x()) + row_part;
      if (w > cell->inverse_depth) *cell = {w, slope};
    }
  }
}

bool DepthBuffer::hides(const Eigen::Vector3d& point_cam) const {
  const auto z = static_cast<float>(point_cam.z());
  const Eigen::Vector3f ray = (point_cam / point_cam.z()).cast<float>();
  const float x = (ray.x() + tangents_.x()) / cell_ - 0.5F, y = (ray.y() + tangents_.y()) / cell_ - 0.5F;
  const int column = static_cast<int>(std::floor(x)), row = static_cast<int>(std::floor(y));
  const auto cell = [&](int c, int r) -> const Cell* {
    if (c < 0 || r < 0 || c >= columns_ || r >= rows_) return nullptr;
    return &cells_[static_cast<std::size_t>(r) * static_cast<std::size_t>(columns_) +
                   static_cast<std::size_t>(c)];
  };
  // The four cells around the point are asked at the point itself, those further out for silhouettes.
  for (int r = row - 1; r <= row + 2; ++r)
    for (int c = column - 1; c <= column + 2; ++c) {
      const Cell* const near = cell(c, r);
      if (near == nullptr || !(near->inverse_depth > 0)) continue;
      const bool around = r >= row && r <= row + 1 && c >= column && c <= column + 1;
      if (around && near->slope.dot(ray) * (z - kSlack_m - kSlackShare * z) > 1) return true;
      if (near->inverse_depth * (z - kSilhouetteShare * z) > 1) return true;
    }
  return false;
}

}  // namespace evpose
