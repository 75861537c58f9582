// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "evpose/sim/light/shade_queue.h"
#include "evpose/sim/light/tile_samples.h"

namespace evpose::sim {

/// What a tile may show during a block.
struct TilePlan {
  Tile tile;
  std::span<const std::uint32_t> triangles;  ///< static, nearest first
  struct Mover {
    int part;
    int x0, y0, x1, y1;  ///< pixels that it may cover: [x0, x1) x [y0, y1)
  };
  std::vector<Mover> movers;
};

/// Mean luminance of each pixel of a tile at one instant. A pixel that one surface fills is shaded once.
/// Where two surfaces meet in a pixel, each is weighted by its area on its side of the edge line. In more
/// involved pixels the edges are searched along scan lines.
class TileSampler {
 public:
  /// Keeps references. `rays` row by row.
  TileSampler(const PreparedScene& prepared, const std::vector<PixelRay>& rays, ImageSize size)
      : prepared_(prepared), rays_(rays), size_(size) {}

  /// Keeps a reference to the plan.
  void set_plan(const TilePlan& plan);
  void sample(const SceneView& view, TileSamples& out);

  /// Luminance of pixels of static patches at another instant: `add` each, then `shade`.
  class Again {
   public:
    Again(TileSampler& sampler, const SceneView& view) : sampler_(sampler) {
      sampler.queue_.set_view(sampler.prepared_, view);
    }
    std::size_t add(std::size_t pixel, std::int32_t patch) {
      return sampler_.queue_.add(sampler_.queue_.number_of(-1, patch), pixel, sampler_.raster_.x()[pixel],
                                 sampler_.raster_.y()[pixel]);
    }
    void shade() { sampler_.queue_.shade(); }
    float luminance(std::size_t answer) const { return sampler_.queue_.luminance(answer); }

   private:
    TileSampler& sampler_;
  };

  const PixelRay& ray(std::size_t pixel) const {
    const std::size_t x = pixel % kTilePx, y = pixel / kTilePx;
    return rays_[(plan_->tile.y0 + y) * size_.width + plan_->tile.x0 + x];
  }

 private:
  struct Hit {
    std::int32_t group = kSky, patch = -1;
    int part = -1;
    std::uint32_t triangle = 0;
    std::int32_t shape = kSky;                     ///< of static surfaces: in the raster
    float nearness = 0;                            ///< 1 / m
    Eigen::Vector2f at = Eigen::Vector2f::Zero();  ///< offset from the centre of the pixel, px
  };
  using Hits = std::array<Hit, 5>;  ///< of the centre and the corners, corners row by row
  /// A pixel whose luminance waits for that of its surfaces.
  struct Pending {
    std::size_t pixel;
    float weight;
    std::size_t answer;
  };
  struct Side {
    std::size_t pixel, group_answer, other_answer;
    float fraction;  ///< of the pixel that the group fills
  };

  /// Areas of pixels overlap: their corners are not those of the raster.
  bool is_wide() const { return rays_[0].width > 1; }
  Hit hit_of(std::int32_t shape, float x, float y) const;
  void add_mover(int part, std::span<const Eigen::Vector3f> directions, std::span<Hit*> hits);
  void trace_movers();
  Hit hit_at(std::size_t place) const;
  std::int32_t number_of_shape(std::int32_t shape);
  bool find_movers(std::size_t pixel);
  void sample_uniform(TileSamples& out);
  void sample_pixels(TileSamples& out);
  void sample_inside(std::size_t pixel, TileSamples& out);
  void sample_border(std::size_t pixel, TileSamples& out);
  Hits hits_of(std::size_t pixel) const;
  Hits wide_hits_of(std::size_t pixel);
  std::size_t want(const Hit& hit, std::size_t pixel, float x, float y);
  void want_sides(std::size_t pixel, const Hits& hits, BorderSample& border);
  void want_scan_lines(std::size_t pixel, const Hits& hits);
  void scan(std::size_t pixel, bool across_columns, float begin, float end);
  std::array<Hit, kLanes> hits_along(const PixelRay& ray, const std::array<Eigen::Vector2f, kLanes>& at);
  bool fit_border(const PixelRay& ray, const Hits& hits, std::int32_t group, BorderSample& out) const;
  bool separates(const Border& border, const PixelRay& ray, const Hits& hits, std::int32_t group,
                 BorderSample& out) const;
  bool is_geometric_edge(const Hit& a, const Hit& b, const PixelRay& ray) const;
  void set_centre(const Hit& hit, std::size_t pixel, TileSamples& out) const;

  const PreparedScene& prepared_;
  const std::vector<PixelRay>& rays_;
  ImageSize size_;
  const SceneView* view_ = nullptr;
  const TilePlan* plan_ = nullptr;
  TileRaster raster_;
  ShadeQueue queue_;
  std::vector<std::int32_t> numbers_;  ///< in the queue, of each shape
  std::vector<int> movers_;            ///< moving parts that may cover the current pixel
  std::vector<Hit> moved_;             ///< at all places; empty: nothing moves here
  std::vector<Hit> between_;           ///< of a widened pixel: half-way to its corners
  std::vector<Eigen::Vector3f> directions_, in_part_;
  std::vector<Hit*> wanted_;
  std::vector<RayCaster::BatchHit> traced_;
  std::vector<Pending> pending_;
  std::vector<Side> sides_;
};

}  // namespace evpose::sim
