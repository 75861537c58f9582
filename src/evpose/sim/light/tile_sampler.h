// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "evpose/sim/light/scene_view.h"

namespace evpose::sim {

inline constexpr std::int32_t kSky = -1;   ///< group where there is no surface
inline constexpr std::int32_t kNone = -2;  ///< no second group: one group fills the pixel
inline constexpr std::int32_t kMany = -3;  ///< more than two groups, or a border that is not a straight line

/// Content of a pixel at one instant. Where it shows two groups, their border is kept, so that luminance can
/// be interpolated while the border moves.
struct PixelSample {
  float luminance = 0;  ///< cd/m^2, mean over the pixel
  std::int32_t group = kSky, other = kNone;
  std::uint16_t object = 0;  ///< at the centre
  std::int8_t part = -1;     ///< at the centre: moving part, -1: none
  bool moving = false;       ///< the pixel shows a moving part
  bool outline = false;      ///< the pixel contains a geometric edge
  // The rest is valid where `other` is a group.
  float group_luminance = 0, other_luminance = 0;  ///< luminance of the two
  bool group_above = false;                        ///< `group` is on the positive side of the border
  std::uint8_t edge = 0;  ///< 0 to 2: of a triangle; 3: intersection of two static planes
  std::int8_t edge_part = -1;
  std::uint32_t a = 0, b = 0;  ///< triangle, or the two patches
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
Border border_of(const PreparedScene& prepared, const SceneView& view, const PixelSample& sample);

/// What a pixel may show during a block.
enum class PixelClass : std::uint8_t {
  flat,    ///< one patch
  smooth,  ///< one group
  mixed,   ///< several groups or moving parts
};

inline constexpr int kTilePx = 16;

/// A square of the image.
struct Tile {
  int x0 = 0, y0 = 0, width = 0, height = 0;  ///< up to kTilePx each way
};

/// Class of each pixel of a tile, known before it is sampled; index: row by row, kTilePx apart.
struct TilePlan {
  Tile tile;
  std::array<PixelClass, kTilePx * kTilePx> pixel{};
  std::array<std::int32_t, kTilePx * kTilePx> patch{};  ///< of flat pixels
  struct Mover {
    int part;
    int x0, y0, x1, y1;  ///< pixels that it may cover: [x0, x1) x [y0, y1)
  };
  std::vector<Mover> movers;
};

using TileSamples = std::array<PixelSample, kTilePx * kTilePx>;

/// Mean luminance of each pixel of a tile at one instant. A pixel that one surface fills is shaded once.
/// Where two surfaces meet in a pixel, each is weighted by its area on its side of the edge line. In more
/// involved pixels the edges are searched along scan lines.
class TileSampler {
 public:
  /// Keeps references. `rays` row by row.
  TileSampler(const PreparedScene& prepared, const std::vector<PixelRay>& rays, ImageSize size)
      : prepared_(prepared), rays_(rays), size_(size) {}

  void sample(const SceneView& view, const TilePlan& plan, TileSamples& out);

  /// One pixel of one patch at another instant.
  float flat_luminance(const SceneView& view, std::int32_t patch, int x, int y) const {
    return luminance(prepared_, view, make_patch_view(view, prepared_.still.patches[patch], -1), ray(x, y));
  }
  const PixelRay& ray(int x, int y) const { return rays_[static_cast<std::size_t>(y) * size_.width + x]; }

 private:
  struct Hit {
    std::int32_t group = kSky, patch = -1;
    int part = -1;
    std::uint32_t triangle = 0;
    float depth = 0;
    Eigen::Vector2f at = Eigen::Vector2f::Zero();  ///< offset from the centre of the pixel, px
  };
  struct Batch;

  Hit trace(const PixelRay& ray, float x, float y) const;
  Hit hit_of(std::uint32_t triangle, float depth, int part) const;
  void add_movers(const PixelRay& ray, float x, float y, Hit& hit) const;
  void find_movers(int x, int y);
  void trace_centres();
  void trace_corners();
  bool near_border(int x, int y) const;
  std::array<Hit, 5> centre_and_corners(int x, int y) const;
  float shade(const Hit& hit, const PixelRay& ray, float x, float y);
  const PatchView& patch_view(int part, std::int32_t patch);
  void sample_mixed(int x, int y, PixelSample& out);
  void sample_border(int x, int y, PixelSample& out);
  bool fit_border(const PixelRay& ray, const std::array<Hit, 5>& hits, PixelSample& out);
  bool separates(const Border& border, const PixelRay& ray, const std::array<Hit, 5>& hits,
                 PixelSample& out) const;
  bool is_geometric_edge(const Hit& a, const Hit& b, const PixelRay& ray) const;
  float scan_lines_luminance(const PixelRay& ray, const std::array<Hit, 5>& hits);
  void copy_hit(const Hit& hit, PixelSample& out) const;

  const PreparedScene& prepared_;
  const std::vector<PixelRay>& rays_;
  ImageSize size_;
  const SceneView* view_ = nullptr;
  const TilePlan* plan_ = nullptr;
  std::vector<int> movers_;  ///< moving parts that may cover the current pixel
  std::vector<PatchView> patch_views_;
  std::size_t last_view_ = 0;
  static constexpr int kCorners = kTilePx + 1;
  std::array<Hit, kTilePx * kTilePx> centres_;
  std::array<bool, kTilePx * kTilePx>
      at_border_{};  ///< mixed pixels that need more than the ray of their centre
  std::array<Hit, kCorners * kCorners> corners_;
};

}  // namespace evpose::sim
