// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/light/tile_raster.h"

#include <algorithm>
#include <limits>

namespace evpose::sim {
namespace {

/// Rounding never takes a direction of the tile out of its corners.
constexpr float kMargin_px = 0.05F;
/// Of depths that count as different.
constexpr float kRounding = 1 - 1e-4F;

// Where the triangle is nearer than `nearness`.
IntLanes in_front(const TriangleShape& shape, FloatLanes x, FloatLanes y, FloatLanes nearness,
                  FloatLanes& own) {
  own = along(shape.nearness, x, y);
  return (own > nearness) & (along(shape.side[0], x, y) >= 0.0F) & (along(shape.side[1], x, y) >= 0.0F) &
         (along(shape.side[2], x, y) >= 0.0F);
}

}  // namespace

void TileRaster::set_tile(const std::vector<PixelRay>& rays, ImageSize size, const Tile& tile) {
  const auto ray = [&](int x, int y) -> const PixelRay& {
    return rays[static_cast<std::size_t>(tile.y0 + std::min(y, tile.height - 1)) * size.width + tile.x0 +
                std::min(x, tile.width - 1)];
  };
  std::size_t i = 0;
  for (int y = 0; y < kTilePx; ++y) {
    for (int x = 0; x < kTilePx; ++x, ++i) {
      x_[i] = ray(x, y).at.x();
      y_[i] = ray(x, y).at.y();
    }
  }
  // A corner is the upper left one of its pixel, or at the end of the tile a right or lower one of the last.
  for (int y = 0; y < kCorners; ++y) {
    for (int x = 0; x < kCorners; ++x, ++i) {
      const Eigen::Vector3f at =
          ray(x, y).direction(x < tile.width ? -0.5F : 0.5F, y < tile.height ? -0.5F : 0.5F);
      x_[i] = at.x();
      y_[i] = at.y();
    }
  }
  for (; i < x_.size(); ++i) x_[i] = x_[0], y_[i] = y_[0];
  corners_ = tile.corners(rays, size, kMargin_px);
}

// Keeps the triangles that the tile shows in this view.
void TileRaster::choose(const PreparedScene& prepared, const SceneView& view,
                        std::span<const std::uint32_t> triangles) {
  const Mesh& mesh = prepared.scene.mesh;
  const Eigen::Matrix3d R_cam_map = view.R_map_cam.transpose();
  shapes_.clear();
  float covered = 0;
  bool covers = false;
  for (const std::uint32_t triangle : triangles) {
    Shape shape;
    shape.triangle = triangle;
    shape.patch = prepared.still.patch_of[triangle];
    const Patch& patch = prepared.still.patches[shape.patch];
    shape.group = patch.group;
    std::array<Eigen::Vector3d, 3> corner;
    for (int k = 0; k < 3; ++k)
      corner[k] = R_cam_map * (mesh.vertices[mesh.triangles[triangle][k]].cast<double>() - view.T_map_cam.p);
    const auto plane = triangle_shape(corner, R_cam_map * patch.normal,
                                      -(patch.normal.dot(view.T_map_cam.p) + patch.offset), &shape.edges);
    if (!plane) continue;
    shape.plane = *plane;
    std::array<int, 3> outside{};
    float least = std::numeric_limits<float>::infinity();
    for (const Eigen::Vector3f& at : corners_) {
      for (int k = 0; k < 3; ++k) outside[k] += plane->side[k].dot(at) < 0;
      const float nearness = plane->nearness.dot(at);
      least = std::min(least, nearness);
      shape.largest = std::max(shape.largest, nearness);
    }
    if (*std::max_element(outside.begin(), outside.end()) == 4 || !(shape.largest > covered * kRounding))
      continue;
    if (outside == std::array<int, 3>{} && least > covered) {
      covered = least;
      covers = true;
    }
    shapes_.push_back(shape);
  }
  std::erase_if(shapes_, [&](const Shape& s) { return s.largest < covered * kRounding; });
  uniform_ = shapes_.empty() || (shapes_.size() == 1 && covers);
}

void TileRaster::draw(const PreparedScene& prepared, const SceneView& view,
                      std::span<const std::uint32_t> triangles) {
  choose(prepared, view, triangles);
  if (uniform_) {
    shape_.fill(shapes_.empty() ? kSky : 0);
    group_.fill(shapes_.empty() ? kSky : shapes_[0].group);
    largest_nearness_ = shapes_.empty() ? 0 : shapes_[0].largest;
    return;
  }
  FloatLanes largest{};
  for (int i = 0; i < kPlaces; i += kLanes) {
    const FloatLanes x = load(&x_[i]), y = load(&y_[i]);
    FloatLanes nearest{};
    IntLanes shape = IntLanes{} + kSky, group = shape;
    for (std::size_t s = 0; s < shapes_.size(); ++s) {
      FloatLanes own;
      const IntLanes front = in_front(shapes_[s].plane, x, y, nearest, own);
      nearest = select(front, own, nearest);
      shape = select(front, IntLanes{} + static_cast<std::int32_t>(s), shape);
      group = select(front, IntLanes{} + shapes_[s].group, group);
    }
    store(&shape_[i], shape);
    store(&group_[i], group);
    largest = larger(largest, nearest);
  }
  largest_nearness_ = 0;
  for (int i = 0; i < kLanes; ++i) largest_nearness_ = std::max<float>(largest_nearness_, largest[i]);
}

TileRaster::Found TileRaster::find(FloatLanes x, FloatLanes y) const {
  Found out{IntLanes{} + kSky, FloatLanes{}};
  for (std::size_t s = 0; s < shapes_.size(); ++s) {
    FloatLanes own;
    const IntLanes front = in_front(shapes_[s].plane, x, y, out.nearness, own);
    out.nearness = select(front, own, out.nearness);
    out.shape = select(front, IntLanes{} + static_cast<std::int32_t>(s), out.shape);
  }
  return out;
}

}  // namespace evpose::sim
