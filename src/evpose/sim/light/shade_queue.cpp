// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/light/shade_queue.h"

#include <algorithm>

#include "evpose/sim/light/tile_raster.h"

namespace evpose::sim {

void ShadeQueue::set_tile(const std::vector<PixelRay>& rays, ImageSize size, const Tile& tile) {
  for (std::size_t i = 0; i < column_x_.size(); ++i) {
    const int x = std::min(static_cast<int>(i % kTilePx), tile.width - 1),
              y = std::min(static_cast<int>(i / kTilePx), tile.height - 1);
    const PixelRay& ray = rays[static_cast<std::size_t>(tile.y0 + y) * size.width + tile.x0 + x];
    column_x_[i] = ray.per_column.x();
    column_y_[i] = ray.per_column.y();
    row_x_[i] = ray.per_row.x();
    row_y_[i] = ray.per_row.y();
  }
}

void ShadeQueue::set_view(const PreparedScene& prepared, const SceneView& view) {
  prepared_ = &prepared;
  view_ = &view;
  patches_.clear();
  places_.clear();
}

std::int32_t ShadeQueue::number_of(int part, std::int32_t patch) {
  const Patch* wanted = &prepared_->surfaces_of(part).patches[patch];
  for (std::size_t i = 0; i < patches_.size(); ++i)
    if (patches_[i].patch == wanted) return static_cast<std::int32_t>(i);
  patches_.push_back(make_patch_view(*view_, *wanted, part));
  return static_cast<std::int32_t>(patches_.size() - 1);
}

void ShadeQueue::shade_all(std::int32_t number, const float* x, const float* y, float* out) const {
  for (int i = 0; i < kTilePixels; i += kLanes) {
    const RayAreas<FloatLanes> areas{load(x + i),         load(y + i),      load(&column_x_[i]),
                                     load(&column_y_[i]), load(&row_x_[i]), load(&row_y_[i])};
    store(out + i, number == kSky ? sky_luminance(*prepared_, *view_, areas)
                                  : sim::luminance(*prepared_, *view_, patches_[number], areas));
  }
}

FloatLanes ShadeQueue::shade_lanes(const PatchView* patch, const std::uint32_t* places) const {
  RayAreas<FloatLanes> areas;
  IntLanes pixel;
  for (int i = 0; i < kLanes; ++i) {
    const Place& place = places_[places[i]];
    areas.x[i] = place.x;
    areas.y[i] = place.y;
    pixel[i] = place.pixel;
  }
  areas.column_x = gather(column_x_.data(), pixel);
  areas.column_y = gather(column_y_.data(), pixel);
  areas.row_x = gather(row_x_.data(), pixel);
  areas.row_y = gather(row_y_.data(), pixel);
  return patch == nullptr ? sky_luminance(*prepared_, *view_, areas)
                          : sim::luminance(*prepared_, *view_, *patch, areas);
}

void ShadeQueue::shade() {
  // Places sorted by patch; the sky has the last number.
  const std::size_t kinds = patches_.size() + 1;
  const auto kind = [&](const Place& p) {
    return p.number == kSky ? kinds - 1 : static_cast<std::size_t>(p.number);
  };
  first_.assign(kinds + 1, 0);
  for (const Place& p : places_) ++first_[kind(p) + 1];
  for (std::size_t k = 0; k < kinds; ++k) first_[k + 1] += first_[k];
  order_.resize(places_.size());
  for (std::size_t i = 0; i < places_.size(); ++i)
    order_[first_[kind(places_[i])]++] = static_cast<std::uint32_t>(i);
  answers_.resize(places_.size());
  std::size_t at = 0;  // `first_` of a kind is now the end of it
  for (std::size_t k = 0; k < kinds; ++k) {
    const PatchView* patch = k + 1 < kinds ? &patches_[k] : nullptr;
    for (; at < first_[k]; at += kLanes) {
      const std::size_t n = std::min<std::size_t>(kLanes, first_[k] - at);
      std::array<std::uint32_t, kLanes> places;
      for (std::size_t i = 0; i < kLanes; ++i) places[i] = order_[at + std::min(i, n - 1)];
      const FloatLanes light = shade_lanes(patch, places.data());
      for (std::size_t i = 0; i < n; ++i) answers_[places[i]] = light[i];
    }
    at = first_[k];
  }
}

}  // namespace evpose::sim
