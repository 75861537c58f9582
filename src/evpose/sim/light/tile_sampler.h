// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "evpose/sim/light/view.h"

namespace evpose::sim {

inline constexpr std::int32_t kSky = -1;   ///< group where no surface is
inline constexpr std::int32_t kNone = -2;  ///< no second group: the pixel lies within one
inline constexpr std::int32_t kMany = -3;  ///< more than two, or a border that is no straight line

/// What a pixel shows at one instant. Where two groups share it, the border is kept, so that the luminance
/// can be followed while the border moves on.
struct PixelSample {
  float luminance = 0;  ///< cd/m^2, mean over the pixel
  std::int32_t group = kSky, other = kNone;
  std::uint16_t object = 0;  ///< at the centre
  std::int8_t part = -1;     ///< at the centre: moving part, -1: none
  bool moving = false;       ///< a moving part is in the pixel
  bool outline = false;      ///< surfaces meet in the pixel
  // The rest where `other` is a group.
  float of_group = 0, of_other = 0;  ///< luminance of the two
  bool group_above = false;          ///< `group` lies where the border's function is positive
  std::uint8_t edge = 0;             ///< 0 to 2: of a triangle; 3: where two planes of what stands still meet
  std::int8_t edge_part = -1;
  std::uint32_t a = 0, b = 0;  ///< triangle, or the two patches
};

/// A border between two groups in the image: positive and negative side of function . (x, y, 1).
struct Border {
  Eigen::Vector3d function;
  float level(const PixelRay& ray) const {
    return static_cast<float>(function.dot(ray.direction().cast<double>()));
  }
  Eigen::Vector2f slope(const PixelRay& ray) const {
    const Eigen::Vector2f f = function.head<2>().cast<float>();
    return {f.dot(ray.per_column), f.dot(ray.per_row)};
  }
  float share_above(const PixelRay& ray) const { return sim::share_above(level(ray), slope(ray)); }
};
Border border_of(const Stage& stage, const View& view, const PixelSample& sample);

/// How much there is to find out about a pixel.
enum class PixelClass : std::uint8_t {
  flat,    ///< only one patch is near
  smooth,  ///< only one group is near
  open,    ///< anything
};

inline constexpr int kTilePx = 16;

/// A square of the image.
struct Tile {
  int x0 = 0, y0 = 0, width = 0, height = 0;  ///< up to kTilePx each way
};

/// What was found out about a tile before it is sampled; index: row by row, kTilePx apart.
struct TilePlan {
  Tile tile;
  std::array<PixelClass, kTilePx * kTilePx> pixel{};
  std::array<std::int32_t, kTilePx * kTilePx> patch{};  ///< of flat pixels
  struct Mover {
    int part;
    int x0, y0, x1, y1;  ///< pixels it may touch: [x0, x1) x [y0, y1)
  };
  std::vector<Mover> movers;
};

using TileSamples = std::array<PixelSample, kTilePx * kTilePx>;

/// Mean luminance of each pixel of a tile at one instant. Pixels that one surface fills are shaded at once;
/// where two meet their shares are those of the edge's line; where it is more involved the edges are searched
/// for along scan lines.
class TileSampler {
 public:
  /// Keeps references. `rays` row by row.
  TileSampler(const Stage& stage, const std::vector<PixelRay>& rays, ImageSize size)
      : stage_(stage), rays_(rays), size_(size) {}

  void sample(const View& view, const TilePlan& plan, TileSamples& out);

  /// One pixel of one patch at another instant.
  float flat_luminance(const View& view, std::int32_t patch, int x, int y) const {
    return luminance(stage_, view, view_patch(view, stage_.still.patches[patch], -1), ray(x, y));
  }
  const PixelRay& ray(int x, int y) const { return rays_[static_cast<std::size_t>(y) * size_.width + x]; }

 private:
  struct Hit {
    std::int32_t group = kSky, patch = -1;
    int part = -1;
    std::uint32_t triangle = 0;
    float depth = 0;
    Eigen::Vector2f at = Eigen::Vector2f::Zero();  ///< in pixels from the pixel's centre
  };
  struct Batch;

  Hit trace(const PixelRay& ray, float x, float y) const;
  Hit hit_of(std::uint32_t triangle, float depth, int part) const;
  void add_movers(const PixelRay& ray, float x, float y, Hit& hit) const;
  void find_movers(int x, int y);
  void trace_centres();
  void trace_corners();
  bool near_border(int x, int y) const;
  std::array<Hit, 5> around(int x, int y) const;
  float shade(const Hit& hit, const PixelRay& ray, float x, float y);
  const PatchView& patch_view(int part, std::int32_t patch);
  void sample_open(int x, int y, PixelSample& out);
  void sample_border(int x, int y, PixelSample& out);
  bool split(const PixelRay& ray, const std::array<Hit, 5>& hits, PixelSample& out);
  bool separates(const Border& border, const PixelRay& ray, const std::array<Hit, 5>& hits,
                 PixelSample& out) const;
  bool parted(const Hit& a, const Hit& b, const PixelRay& ray) const;
  float scan(const PixelRay& ray, const std::array<Hit, 5>& hits);
  void describe_hit(const Hit& hit, PixelSample& out) const;

  const Stage& stage_;
  const std::vector<PixelRay>& rays_;
  ImageSize size_;
  const View* view_ = nullptr;
  const TilePlan* plan_ = nullptr;
  std::vector<int> movers_;  ///< that may touch the pixel at hand
  std::vector<PatchView> patch_views_;
  std::size_t last_view_ = 0;
  static constexpr int kCorners = kTilePx + 1;
  std::array<Hit, kTilePx * kTilePx> centres_;
  std::array<bool, kTilePx * kTilePx> at_border_{};  ///< open pixels that more than their centre is asked of
  std::array<Hit, kCorners * kCorners> corners_;
};

}  // namespace evpose::sim
