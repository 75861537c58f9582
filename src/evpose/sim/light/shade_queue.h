// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "evpose/sim/light/scene_view.h"
#include "evpose/sim/light/tile.h"

namespace evpose::sim {

/// Luminance that is wanted at places of a tile in one view; computed patch by patch, eight places at once.
class ShadeQueue {
 public:
  /// The areas of the tile's pixels.
  void set_tile(const std::vector<PixelRay>& rays, ImageSize size, const Tile& tile);
  void set_view(const PreparedScene& prepared, const SceneView& view);

  /// Number of a patch in this view, for add(). kSky: the sky.
  std::int32_t number_of(int part, std::int32_t patch);
  /// Wants the mean over an area as large as pixel `pixel` of the tile, around the direction (x, y, 1).
  /// Returns the number of the answer.
  std::size_t add(std::int32_t number, std::size_t pixel, float x, float y) {
    const std::size_t answer = places_.size();
    places_.push_back({number, static_cast<std::int32_t>(pixel), x, y});
    return answer;
  }
  void shade();
  float luminance(std::size_t answer) const { return answers_[answer]; }

  /// All pixels of the tile show one patch.
  void shade_all(std::int32_t number, const float* x, const float* y, float* out) const;

 private:
  struct Place {
    std::int32_t number, pixel;
    float x, y;
  };
  /// `patch` nullptr: the sky.
  FloatLanes shade_lanes(const PatchView* patch, const std::uint32_t* places) const;

  const PreparedScene* prepared_ = nullptr;
  const SceneView* view_ = nullptr;
  std::vector<PatchView> patches_;
  alignas(32) std::array<float, kTilePixels> column_x_, column_y_, row_x_, row_y_;
  std::vector<Place> places_;
  std::vector<float> answers_;
  std::vector<std::uint32_t> first_, order_;
};

}  // namespace evpose::sim
