// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/sensors/surface_image.h"

#include <algorithm>
#include <array>
#include <limits>

namespace evpose::sim {
namespace {

// True if all values of the box, in both images, are the same.
bool uniform(const std::vector<std::int32_t>& a, const std::vector<std::int32_t>& b, int width,
             const PixelBox& box) {
  const std::int32_t first = a[static_cast<std::size_t>(box.y0) * width + box.x0];
  for (int y = box.y0; y < box.y1; ++y) {
    const std::int32_t* row_a = &a[static_cast<std::size_t>(y) * width];
    const std::int32_t* row_b = &b[static_cast<std::size_t>(y) * width];
    bool same = true;
    for (int x = box.x0; x < box.x1; ++x) same = same && row_a[x] == first && row_b[x] == first;
    if (!same) return false;
  }
  return true;
}

}  // namespace

float trace_tile(const PreparedScene& prepared, const std::vector<PixelRay>& rays, ImageSize size,
                 const Tile& tile, const Pose& T_map_cam, SurfaceImage& image) {
  const Eigen::Matrix3d R = T_map_cam.rotation();
  float nearest = std::numeric_limits<float>::infinity();
  std::array<Eigen::Vector3f, kTilePx> directions;
  std::array<RayCaster::BatchHit, kTilePx> hits;
  for (int y = tile.y0; y < tile.y0 + tile.height; ++y) {
    const std::size_t first = static_cast<std::size_t>(y) * size.width + tile.x0;
    for (int x = 0; x < tile.width; ++x)
      directions[x] = (R * rays[first + x].direction().cast<double>()).cast<float>();
    prepared.rays.trace_batch(T_map_cam.p, {directions.data(), static_cast<std::size_t>(tile.width)}, hits);
    for (int x = 0; x < tile.width; ++x) {
      const std::size_t i = first + x;
      const bool met = hits[x].triangle != RayCaster::kNoTriangle;
      image.patch[i] = met ? prepared.still.patch_of[hits[x].triangle] : -1;
      image.group[i] = met ? prepared.still.patches[image.patch[i]].group : kSky;
      nearest = std::min(nearest, hits[x].distance);
    }
  }
  return std::max(nearest, static_cast<float>(kNearest_m));
}

void classify_tile(const SurfaceImage& before, const SurfaceImage& after, ImageSize size, int reach,
                   TilePlan& plan) {
  const Tile& tile = plan.tile;
  const PixelBox around{tile.x0 - reach, tile.y0 - reach, tile.x0 + tile.width + reach,
                        tile.y0 + tile.height + reach};
  const auto inside = [&](const PixelBox& box) {
    return box.x0 >= 0 && box.y0 >= 0 && box.x1 <= size.width && box.y1 <= size.height;
  };
  const bool all_flat = inside(around) && uniform(before.patch, after.patch, size.width, around);
  for (int y = 0; y < tile.height; ++y) {
    for (int x = 0; x < tile.width; ++x) {
      const int column = tile.x0 + x, row = tile.y0 + y;
      const std::size_t i = static_cast<std::size_t>(y) * kTilePx + x;
      plan.patch[i] = before.patch[static_cast<std::size_t>(row) * size.width + column];
      if (all_flat) {
        plan.pixel[i] = PixelClass::flat;
        continue;
      }
      const PixelBox window{column - reach, row - reach, column + reach + 1, row + reach + 1};
      if (!inside(window) || !uniform(before.group, after.group, size.width, window))
        plan.pixel[i] = PixelClass::mixed;
      else
        plan.pixel[i] =
            uniform(before.patch, after.patch, size.width, window) ? PixelClass::flat : PixelClass::smooth;
    }
  }
}

}  // namespace evpose::sim
