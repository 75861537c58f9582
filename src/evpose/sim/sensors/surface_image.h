// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/sim/light/prepared_scene.h"
#include "evpose/sim/light/tile_sampler.h"

namespace evpose::sim {

/// Surfaces nearer than this do not raise the bound of the optical flow any further.
inline constexpr double kNearest_m = 0.02;

/// Pixels [x0, x1) x [y0, y1).
struct PixelBox {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;
};

/// The static surface that the centre of each pixel sees; row by row.
struct SurfaceImage {
  std::vector<std::int32_t> group, patch;
};

/// Traces the pixels of a tile into `image`. Returns the distance of the nearest surface, kNearest_m at
/// least.
float trace_tile(const PreparedScene& prepared, const std::vector<PixelRay>& rays, ImageSize size,
                 const Tile& tile, const Pose& T_map_cam, SurfaceImage& image);

/// Sets class and patch of each pixel of a tile for a block between two surface images, in which nothing
/// moves by more than `reach` pixels.
void classify_tile(const SurfaceImage& before, const SurfaceImage& after, ImageSize size, int reach,
                   TilePlan& plan);

}  // namespace evpose::sim
