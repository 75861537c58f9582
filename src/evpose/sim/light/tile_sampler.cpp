// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/light/tile_sampler.h"

#include <algorithm>
#include <limits>

namespace evpose::sim {
namespace {

constexpr std::int32_t kUnknown = -2;  // number in the queue

// Places of the corners of a pixel.
std::array<std::size_t, 4> corner_places(std::size_t pixel) {
  const std::size_t first = TileRaster::kCentres + pixel / kTilePx * TileRaster::kCorners + pixel % kTilePx;
  return {first, first + 1, first + TileRaster::kCorners, first + TileRaster::kCorners + 1};
}

}  // namespace

void TileSampler::set_plan(const TilePlan& plan) {
  plan_ = &plan;
  raster_.set_tile(rays_, size_, plan.tile);
  queue_.set_tile(rays_, size_, plan.tile);
}

TileSampler::Hit TileSampler::hit_of(std::int32_t shape, float x, float y) const {
  Hit hit;
  if (shape == kSky) return hit;
  const TileRaster::Shape& s = raster_.shapes()[shape];
  hit.group = s.group;
  hit.patch = s.patch;
  hit.triangle = s.triangle;
  hit.shape = shape;
  hit.nearness = s.plane.nearness.dot(Eigen::Vector3f(x, y, 1));
  return hit;
}

// Moving parts that may cover the pixel.
bool TileSampler::find_movers(std::size_t pixel) {
  movers_.clear();
  const int column = plan_->tile.x0 + static_cast<int>(pixel % kTilePx),
            row = plan_->tile.y0 + static_cast<int>(pixel / kTilePx);
  for (const TilePlan::Mover& m : plan_->movers) {
    if (column >= m.x0 && column < m.x1 && row >= m.y0 && row < m.y1) movers_.push_back(m.part);
  }
  return !movers_.empty();
}

// Puts what a moving part shows in front of hits in some directions.
void TileSampler::add_mover(int part, std::span<const Eigen::Vector3f> directions, std::span<Hit*> hits) {
  const Pose& T_part_cam = view_->T_part_cam[part];
  const Eigen::Matrix3d R_part_cam = T_part_cam.q.toRotationMatrix();
  in_part_.clear();
  for (const Eigen::Vector3f& in_camera : directions)
    in_part_.push_back((R_part_cam * in_camera.cast<double>()).cast<float>());
  traced_.resize(in_part_.size());
  prepared_.rays.trace_part_batch(part, T_part_cam.p, in_part_, traced_);
  const PartSurfaces& surfaces = prepared_.surfaces_of(part);
  for (std::size_t i = 0; i < hits.size(); ++i) {
    Hit& hit = *hits[i];
    if (traced_[i].triangle == RayCaster::kNoTriangle || traced_[i].distance * hit.nearness >= 1) continue;
    hit = {};
    hit.patch = surfaces.patch_of[traced_[i].triangle];
    hit.group = surfaces.patches[hit.patch].group;
    hit.part = part;
    hit.triangle = traced_[i].triangle;
    hit.nearness = 1 / traced_[i].distance;
  }
}

// Hits at all places, where moving parts may be seen.
void TileSampler::trace_movers() {
  moved_.clear();
  if (plan_->movers.empty()) return;
  for (std::size_t place = 0; place < TileRaster::kPlaces; ++place)
    moved_.push_back(hit_of(raster_.shape()[place], raster_.x()[place], raster_.y()[place]));
  constexpr std::size_t kLast = TileRaster::kCentres + TileRaster::kCorners * TileRaster::kCorners;
  for (const TilePlan::Mover& m : plan_->movers) {
    const auto covers = [&](std::size_t column, std::size_t row) {
      const int x = plan_->tile.x0 + static_cast<int>(std::min<std::size_t>(column, kTilePx - 1)),
                y = plan_->tile.y0 + static_cast<int>(std::min<std::size_t>(row, kTilePx - 1));
      return x >= m.x0 && x < m.x1 && y >= m.y0 && y < m.y1;
    };
    directions_.clear();
    wanted_.clear();
    for (std::size_t place = 0; place < kLast; ++place) {
      const bool centre = place < TileRaster::kCentres;
      const std::size_t wide = centre ? kTilePx : TileRaster::kCorners,
                        i = centre ? place : place - TileRaster::kCentres;
      if (!covers(i % wide, i / wide)) continue;
      directions_.emplace_back(raster_.x()[place], raster_.y()[place], 1.0F);
      wanted_.push_back(&moved_[place]);
    }
    if (!wanted_.empty()) add_mover(m.part, directions_, wanted_);
  }
}

TileSampler::Hit TileSampler::hit_at(std::size_t place) const {
  return moved_.empty() ? hit_of(raster_.shape()[place], raster_.x()[place], raster_.y()[place])
                        : moved_[place];
}

TileSampler::Hits TileSampler::hits_of(std::size_t pixel) const {
  constexpr std::array<float, 4> kX = {-0.5F, 0.5F, -0.5F, 0.5F}, kY = {-0.5F, -0.5F, 0.5F, 0.5F};
  const auto corners = corner_places(pixel);
  Hits hits;
  hits[0] = hit_at(pixel);
  for (int i = 0; i < 4; ++i) {
    hits[i + 1] = hit_at(corners[i]);
    hits[i + 1].at = {kX[i], kY[i]};
  }
  return hits;
}

// Asks for the luminance of the surface of a hit around a direction.
std::size_t TileSampler::want(const Hit& hit, std::size_t pixel, float x, float y) {
  std::int32_t number = kSky;
  if (hit.part >= 0) {
    number = queue_.number_of(hit.part, hit.patch);
  } else if (hit.shape != kSky) {
    number = number_of_shape(hit.shape);
  }
  return queue_.add(number, pixel, x, y);
}

std::int32_t TileSampler::number_of_shape(std::int32_t shape) {
  std::int32_t& number = numbers_[shape];
  if (number == kUnknown) number = queue_.number_of(-1, raster_.shapes()[shape].patch);
  return number;
}

void TileSampler::set_centre(const Hit& hit, std::size_t pixel, TileSamples& out) const {
  out.group[pixel] = hit.group;
  out.patch[pixel] = -1;
  out.border[pixel] = -1;
  out.flags[pixel] = 0;
  out.object[pixel] = 0;
  if (hit.group != kSky)
    out.object[pixel] = static_cast<std::uint16_t>(prepared_.surfaces_of(hit.part).patches[hit.patch].object);
}

void TileSampler::sample_uniform(TileSamples& out) {
  const bool sky = raster_.shapes().empty();
  const std::int32_t patch = sky ? -1 : raster_.shapes()[0].patch;
  out.group.fill(sky ? kSky : raster_.shapes()[0].group);
  out.patch.fill(patch);
  out.border.fill(-1);
  out.flags.fill(0);
  out.object.fill(sky ? std::uint16_t{0} : static_cast<std::uint16_t>(prepared_.still.patches[patch].object));
  queue_.shade_all(sky ? kSky : queue_.number_of(-1, patch), raster_.x().data(), raster_.y().data(),
                   out.luminance.data());
}

// A pixel in which nothing but one static surface, or the sky, is seen.
void TileSampler::sample_inside(std::size_t pixel, TileSamples& out) {
  const std::int32_t shape = raster_.shape()[pixel];
  out.border[pixel] = -1;
  out.flags[pixel] = 0;
  out.group[pixel] = raster_.group()[pixel];
  out.patch[pixel] = shape == kSky ? -1 : raster_.shapes()[shape].patch;
  out.object[pixel] = shape == kSky
                          ? std::uint16_t{0}
                          : static_cast<std::uint16_t>(prepared_.still.patches[out.patch[pixel]].object);
  const std::int32_t number = shape == kSky ? kSky : number_of_shape(shape);
  pending_.push_back({pixel, 1, queue_.add(number, pixel, raster_.x()[pixel], raster_.y()[pixel])});
}

void TileSampler::sample_pixels(TileSamples& out) {
  out.luminance.fill(0);
  out.patch.fill(-1);
  out.border.fill(-1);
  numbers_.assign(raster_.shapes().size(), kUnknown);
  pending_.clear();
  sides_.clear();
  trace_movers();
  const auto& group = raster_.group();
  for (int y = 0; y < plan_->tile.height; ++y) {
    for (int x = 0; x < plan_->tile.width; ++x) {
      const std::size_t pixel = static_cast<std::size_t>(y) * kTilePx + x;
      const auto corners = corner_places(pixel);
      const bool inside = !is_wide() && std::all_of(corners.begin(), corners.end(),
                                                    [&](std::size_t c) { return group[c] == group[pixel]; });
      if (inside && (moved_.empty() || !find_movers(pixel))) {
        sample_inside(pixel, out);
      } else {
        sample_border(pixel, out);
      }
    }
  }
  queue_.shade();
  for (const Pending& p : pending_) out.luminance[p.pixel] += p.weight * queue_.luminance(p.answer);
  for (const Side& s : sides_) {
    BorderSample& border = out.borders[out.border[s.pixel]];
    border.group_luminance = queue_.luminance(s.group_answer);
    border.other_luminance = queue_.luminance(s.other_answer);
    out.luminance[s.pixel] = s.fraction * border.group_luminance + (1 - s.fraction) * border.other_luminance;
  }
}

void TileSampler::sample(const SceneView& view, TileSamples& out) {
  view_ = &view;
  raster_.draw(prepared_, view, plan_->triangles);
  queue_.set_view(prepared_, view);
  out.borders.clear();
  if (raster_.uniform() && plan_->movers.empty()) {
    sample_uniform(out);
  } else {
    sample_pixels(out);
  }
}

}  // namespace evpose::sim
