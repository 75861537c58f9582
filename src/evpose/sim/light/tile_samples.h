// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "evpose/sim/light/scene_view.h"
#include "evpose/sim/light/tile_raster.h"

namespace evpose::sim {

inline constexpr std::int32_t kNone = -2;  ///< no second group: one group fills the pixel
inline constexpr std::int32_t kMany = -3;  ///< more than two groups, or a border that is not a straight line

/// The second group in a pixel and the border between the two, so that luminance can be interpolated while
/// the border moves.
struct BorderSample {
  std::int32_t other = kNone;
  // The rest is valid where `other` is a group or the sky.
  float group_luminance = 0, other_luminance = 0;  ///< luminance of the two
  bool group_above = false;                        ///< `group` is on the positive side of the border
  std::uint8_t edge = 0;  ///< 0 to 2: of a triangle; 3: intersection of two static planes
  std::int8_t edge_part = -1;
  std::uint32_t a = 0, b = 0;  ///< triangle, or the two patches
};

/// Content of a pixel at one instant.
struct PixelSample {
  float luminance = 0;  ///< cd/m^2, mean over the pixel
  std::int32_t group = kSky;
  BorderSample border;
};

/// Content of the pixels of a tile at one instant.
struct TileSamples {
  alignas(32) std::array<float, kTilePixels> luminance;  ///< cd/m^2, mean over the pixel
  std::array<std::int32_t, kTilePixels> group;           ///< at the centre
  std::array<std::int32_t, kTilePixels> patch;    ///< static, fills the pixel; -1: there is no such patch
  std::array<std::int16_t, kTilePixels> border;   ///< in `borders`; -1: one group fills the pixel
  std::array<std::uint16_t, kTilePixels> object;  ///< at the centre
  std::array<std::uint8_t, kTilePixels> flags;
  std::vector<BorderSample> borders;

  static constexpr std::uint8_t kMoving = 1;   ///< the pixel shows a moving part
  static constexpr std::uint8_t kOutline = 2;  ///< the pixel contains a geometric edge

  PixelSample pixel(std::size_t i) const {
    return {luminance[i], group[i], border[i] < 0 ? BorderSample{} : borders[border[i]]};
  }
};

/// A straight border between two groups in the image: the zero line of function . (x, y, 1).
struct Border {
  Eigen::Vector3d function;
  float level(const PixelRay& ray) const {
    return static_cast<float>(function.dot(ray.direction().cast<double>()));
  }
  Eigen::Vector2f slope(const PixelRay& ray) const {
    const Eigen::Vector2f f = function.head<2>().cast<float>();
    return {f.dot(ray.per_column), f.dot(ray.per_row)};
  }
  float fraction_above(const PixelRay& ray) const { return sim::fraction_above(level(ray), slope(ray)); }
};
Border border_of(const PreparedScene& prepared, const SceneView& view, const BorderSample& sample);

}  // namespace evpose::sim
