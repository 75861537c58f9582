// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/sensors/pixel_integrator.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

#include "evpose/core/config.h"
#include "evpose/core/parallel.h"
#include "evpose/sim/light/luminance_curve.h"
#include "evpose/sim/light/tile_sampler.h"
#include "evpose/sim/sensors/part_extent.h"
#include "evpose/sim/sensors/surface_image.h"

namespace evpose::sim {
namespace {

// Numbers of samples that a tile may take in a block. All divide kGrid, so that few views serve all tiles.
constexpr std::array<int, 8> kCounts = {1, 2, 3, 4, 6, 8, 12, 16};
constexpr int kGrid = 48;
constexpr double kShortestBlock_s = 2e-6;
constexpr double kMargin = 1.2;  // the flow may get faster within a block

// State of one tile in one block.
struct TileState {
  Tile tile;
  std::array<Eigen::Vector3d, 5> probe;  // rays
  std::array<Matrix23d, 5> jacobian;     // px per change of the ray
  float nearest = 0;                     // m
  double speed = 0;                      // px/s
  std::vector<SimEvent> events;
  PixelIntegratorCounts counts;
};

struct Block {
  TimeNs t0, t1;
  const std::vector<Exposure*>& exposures;
  float glare;
  std::array<SceneView, kGrid + 1> views;  // those that some tile uses
  std::vector<PartExtent> parts;
};

// No pixel of the tile moves faster, in px/s: the flow changes monotonically with 1 / depth.
double tile_speed(const TileState& tile, const CameraMotion& motion) {
  double peak = 0;
  for (int i = 0; i < 5; ++i) {
    const Eigen::Vector2d turn = tile.jacobian[i] * -motion.rate.cross(tile.probe[i]);
    const Eigen::Vector2d shift = tile.jacobian[i] * (-motion.velocity / tile.nearest);
    peak = std::max({peak, turn.norm(), (turn + shift).norm()});
  }
  return peak;
}

// Adds a moving part to the plan of a tile. Returns false if it does not cover the tile.
bool add_part(const PartExtent& part, int number, TilePlan& plan) {
  const PixelBox& box = part.box;
  const Tile& tile = plan.tile;
  if (!part.visible || box.x0 >= tile.x0 + tile.width || box.x1 <= tile.x0 ||
      box.y0 >= tile.y0 + tile.height || box.y1 <= tile.y0)
    return false;
  plan.movers.push_back({number, box.x0, box.y0, box.x1, box.y1});
  for (int y = 0; y < tile.height; ++y) {
    for (int x = 0; x < tile.width; ++x) {
      const int column = tile.x0 + x, row = tile.y0 + y;
      if (column >= box.x0 && column < box.x1 && row >= box.y0 && row < box.y1)
        plan.pixel[static_cast<std::size_t>(y) * kTilePx + x] = PixelClass::mixed;
    }
  }
  return true;
}

}  // namespace

struct PixelIntegrator::Impl {
  Impl(const PreparedScene& s, const Camera& c, const std::vector<PixelRay>& r, CameraPath p,
       const PixelIntegratorConfig& f, EventPixels& e, ThreadPool& t)
      : prepared(s), camera(c), rays(r), path(std::move(p)), config(f), pixels(e), pool(t), size(c.size()) {}

  const PreparedScene& prepared;
  const Camera& camera;
  const std::vector<PixelRay>& rays;
  CameraPath path;
  PixelIntegratorConfig config;
  EventPixels& pixels;
  ThreadPool& pool;
  ImageSize size;
  TimeNs now = 0;
  std::vector<TileState> tiles;
  std::vector<PixelSample> last;  // of every pixel, row by row
  SurfaceImage before, after;     // at the ends of the block
  PixelIntegratorCounts counts;

  SceneView view_at(TimeNs t) const {
    return make_scene_view(prepared, to_seconds(t), path(to_seconds(t)).T_map_cam);
  }
  std::size_t index(int x, int y) const { return static_cast<std::size_t>(y) * size.width + x; }

  void cut_into_tiles();
  void trace_surfaces(const Pose& T_map_cam, SurfaceImage& image);
  TimeNs block_end(TimeNs end);
  void make_views(Block& block) const;
  void set_tile_speeds(TimeNs t0, TimeNs t1, const std::vector<float>& nearest_before);
  float glare() const;
  TilePlan plan_tile(const TileState& tile, const Block& block, int& samples) const;
  void sample_first(const SceneView& view, const Block& block);
  void integrate_tile(TileState& tile, const Block& block);
  void integrate_curve(TileState& tile, const Block& block, const CurveContext& context,
                       const LuminanceCurve& curve, std::size_t pixel);
  void integrate_step(TileState& tile, const Block& block, const TilePlan& plan, const CurveContext& context,
                      const TileSamples& samples);
  void collect(std::vector<SimEvent>& events);
};

void PixelIntegrator::Impl::cut_into_tiles() {
  for (int y = 0; y < size.height; y += kTilePx) {
    for (int x = 0; x < size.width; x += kTilePx) {
      TileState tile;
      tile.tile = {x, y, std::min(kTilePx, size.width - x), std::min(kTilePx, size.height - y)};
      const int right = x + tile.tile.width - 1, low = y + tile.tile.height - 1;
      const std::array<std::array<int, 2>, 5> probes = {
          {{x, y}, {right, y}, {x, low}, {right, low}, {(x + right) / 2, (y + low) / 2}}};
      for (int i = 0; i < 5; ++i) {
        tile.probe[i] = rays[index(probes[i][0], probes[i][1])].direction().cast<double>();
        EVPOSE_CHECK(camera.project(tile.probe[i], &tile.jacobian[i]));
      }
      tiles.push_back(std::move(tile));
    }
  }
}

void PixelIntegrator::Impl::trace_surfaces(const Pose& T_map_cam, SurfaceImage& image) {
  image.group.resize(rays.size());
  image.patch.resize(rays.size());
  pool.for_chunks(tiles.size(), 8, [&](std::size_t, std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k)
      tiles[k].nearest = trace_tile(prepared, rays, size, tiles[k].tile, T_map_cam, image);
  });
}

TimeNs PixelIntegrator::Impl::block_end(TimeNs end) {
  const double t_s = to_seconds(now);
  const CameraMotion motion = path(t_s);
  double peak = 0;
  for (const TileState& tile : tiles) peak = std::max(peak, tile_speed(tile, motion));
  for (const MovingPart& part : prepared.scene.moving) {
    const PartExtent extent = part_extent(part, camera, path, now, 1e-4);
    if (extent.visible) peak = std::max(peak, extent.speed_px_s);
  }
  double length_s = std::min(config.block_s, config.block_px / (kMargin * peak + 1e-9));
  length_s = std::min(length_s, kCounts.back() * prepared.channels.step_s(t_s));
  length_s = std::max(length_s, kShortestBlock_s);
  // Whole microseconds: the times within a block are the same however the recording is divided.
  const TimeNs length = std::max<TimeNs>(1, static_cast<TimeNs>(length_s * 1e6)) * kNsPerUs;
  const double next_switch_s = prepared.channels.next_switch_s(t_s);
  if (next_switch_s < to_seconds(end)) end = std::min(end, std::max(from_seconds(next_switch_s), now + 1));
  return std::min(end, now + length);
}

void PixelIntegrator::Impl::make_views(Block& block) const {
  for (const int n : kCounts) {
    for (int k = 0; k <= n; ++k) {
      SceneView& view = block.views[k * kGrid / n];
      if (view.light.empty()) view = view_at(block.t0 + (block.t1 - block.t0) * (k * kGrid / n) / kGrid);
    }
  }
}

// Peak flow of each tile over the block; `nearest_before` is the nearest distance of each at its start.
void PixelIntegrator::Impl::set_tile_speeds(TimeNs t0, TimeNs t1, const std::vector<float>& nearest_before) {
  const std::array<CameraMotion, 3> motion = {
      path(to_seconds(t0)), path(0.5 * (to_seconds(t0) + to_seconds(t1))), path(to_seconds(t1))};
  for (std::size_t k = 0; k < tiles.size(); ++k) {
    TileState& tile = tiles[k];
    const float nearest_after = tile.nearest;
    tile.nearest = std::min(tile.nearest, nearest_before[k]);
    tile.speed = 0;
    for (const CameraMotion& m : motion) tile.speed = std::max(tile.speed, tile_speed(tile, m));
    tile.nearest = nearest_after;
  }
}

float PixelIntegrator::Impl::glare() const {
  double sum = 0;
  for (const PixelSample& sample : last) sum += sample.luminance;
  return static_cast<float>(config.veiling_glare * sum / static_cast<double>(last.size()));
}

TilePlan PixelIntegrator::Impl::plan_tile(const TileState& tile, const Block& block, int& samples) const {
  TilePlan out;
  out.tile = tile.tile;
  const double length_s = to_seconds(block.t1 - block.t0);
  double motion_px = tile.speed * length_s;
  classify_tile(before, after, size, 1 + static_cast<int>(std::ceil(motion_px)), out);
  for (std::size_t i = 0; i < block.parts.size(); ++i) {
    if (add_part(block.parts[i], static_cast<int>(i), out))
      motion_px = std::max(motion_px, block.parts[i].speed_px_s * length_s);
  }
  const double wanted =
      std::max(motion_px / config.step_px, length_s / prepared.channels.step_s(to_seconds(block.t0)));
  samples = *std::find_if(kCounts.begin(), kCounts.end() - 1, [&](int n) { return n >= wanted - 1e-6; });
  return out;
}

// Integrates one pixel along its luminance curve.
void PixelIntegrator::Impl::integrate_curve(TileState& tile, const Block& block, const CurveContext& context,
                                            const LuminanceCurve& curve, std::size_t pixel) {
  const TimeNs t0 = context.t0, t1 = context.t1;
  TimeNs from_t = t0;
  for (int k = 1; k < curve.knots; ++k) {
    const TimeNs to_t =
        k + 1 == curve.knots ? t1 : t0 + static_cast<TimeNs>(curve.time[k] * static_cast<float>(t1 - t0));
    if (to_t <= from_t) continue;
    pixels.advance(pixel, from_t, to_t, curve.luminance[k - 1] + block.glare,
                   curve.luminance[k] + block.glare, tile.events);
    from_t = to_t;
  }
  tile.counts.knots += curve.knots - 2;
  const double length_ns = static_cast<double>(t1 - t0);
  for (Exposure* exposure : block.exposures) {
    const TimeNs open = std::max(t0, exposure->open), close = std::min(t1, exposure->close);
    if (open >= close) continue;
    const float seen = curve.integral(static_cast<double>(open - t0) / length_ns,
                                      static_cast<double>(close - t0) / length_ns);
    exposure->sum[pixel] += static_cast<float>(to_seconds(t1 - t0)) * seen +
                            static_cast<float>(to_seconds(close - open)) * block.glare;
  }
}

// Integrates every pixel of a tile from its last sample to this one.
void PixelIntegrator::Impl::integrate_step(TileState& tile, const Block& block, const TilePlan& plan,
                                           const CurveContext& context, const TileSamples& samples) {
  for (int y = 0; y < plan.tile.height; ++y) {
    for (int x = 0; x < plan.tile.width; ++x) {
      const std::size_t in_tile = static_cast<std::size_t>(y) * kTilePx + x;
      const std::size_t i = index(plan.tile.x0 + x, plan.tile.y0 + y);
      const PixelSample& sample = samples[in_tile];
      const std::size_t first_event = tile.events.size();
      if (block.exposures.empty() && nearly_equal(last[i], sample)) {
        pixels.advance(i, context.t0, context.t1, last[i].luminance + block.glare,
                       sample.luminance + block.glare, tile.events);
      } else {
        integrate_curve(tile, block, context, luminance_curve(context, last[i], sample, plan, x, y), i);
      }
      const bool outline = sample.outline || last[i].outline, moving = sample.moving || last[i].moving;
      for (std::size_t e = first_event; e < tile.events.size(); ++e) {
        SimEvent& event = tile.events[e];
        event.object = sample.object;
        event.origin = moving ? EventOrigin::moving : outline ? EventOrigin::edge : EventOrigin::texture;
      }
      last[i] = sample;
    }
  }
}

void PixelIntegrator::Impl::integrate_tile(TileState& tile, const Block& block) {
  tile.events.clear();
  tile.counts = {};
  int samples = 1;
  const TilePlan plan = plan_tile(tile, block, samples);
  TileSampler sampler(prepared, rays, size);
  TileSamples current;
  TimeNs t0 = block.t0;
  for (int k = 1; k <= samples; ++k) {
    const int from = (k - 1) * kGrid / samples, to = k * kGrid / samples;
    const TimeNs t1 = block.t0 + (block.t1 - block.t0) * to / kGrid;
    if (t1 == t0) continue;
    sampler.sample(block.views[to], plan, current);
    const CurveContext context{prepared, sampler, block.views[from], block.views[to], t0, t1};
    integrate_step(tile, block, plan, context, current);
    t0 = t1;
  }
  tile.counts.samples += samples * static_cast<std::int64_t>(tile.tile.width) * tile.tile.height;
  tile.counts.mixed_samples += samples * std::count(plan.pixel.begin(), plan.pixel.end(), PixelClass::mixed);
}

void PixelIntegrator::Impl::sample_first(const SceneView& view, const Block& block) {
  last.resize(rays.size());
  pool.for_chunks(tiles.size(), 8, [&](std::size_t, std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      int samples = 0;
      TileSampler sampler(prepared, rays, size);
      TileSamples seen;
      const TilePlan plan = plan_tile(tiles[k], block, samples);
      sampler.sample(view, plan, seen);
      for (int y = 0; y < plan.tile.height; ++y) {
        for (int x = 0; x < plan.tile.width; ++x)
          last[index(plan.tile.x0 + x, plan.tile.y0 + y)] = seen[static_cast<std::size_t>(y) * kTilePx + x];
      }
    }
  });
}

// Appends the events of all tiles, sorted, and adds up their counts.
void PixelIntegrator::Impl::collect(std::vector<SimEvent>& events) {
  const std::size_t first = events.size();
  ++counts.blocks;
  for (const TileState& tile : tiles) {
    events.insert(events.end(), tile.events.begin(), tile.events.end());
    counts.samples += tile.counts.samples;
    counts.mixed_samples += tile.counts.mixed_samples;
    counts.knots += tile.counts.knots;
  }
  std::sort(events.begin() + static_cast<std::ptrdiff_t>(first), events.end(),
            [](const SimEvent& a, const SimEvent& b) {
              return a.t != b.t ? a.t < b.t : a.y != b.y ? a.y < b.y : a.x < b.x;
            });
}

PixelIntegrator::PixelIntegrator(const PreparedScene& prepared, const Camera& camera,
                                 const std::vector<PixelRay>& rays, CameraPath path,
                                 const PixelIntegratorConfig& config, EventPixels& pixels, ThreadPool& pool)
    : impl_(std::make_unique<Impl>(prepared, camera, rays, std::move(path), config, pixels, pool)) {
  impl_->cut_into_tiles();
}

PixelIntegrator::~PixelIntegrator() = default;

const PixelIntegratorCounts& PixelIntegrator::counts() const { return impl_->counts; }

void PixelIntegrator::start(TimeNs t) {
  Impl& m = *impl_;
  m.now = t;
  const SceneView view = m.view_at(t);
  m.trace_surfaces(view.T_map_cam, m.before);
  m.after = m.before;
  const std::vector<Exposure*> none;
  const TimeNs soon = t + kNsPerUs;
  m.sample_first(view, {t, soon, none, 0, {}, part_extents(m.prepared.scene, m.camera, m.path, t, soon)});
  const float glare = m.glare();
  for (std::size_t i = 0; i < m.last.size(); ++i) m.pixels.start(i, t, m.last[i].luminance + glare);
}

TimeNs PixelIntegrator::advance(TimeNs end, const std::vector<Exposure*>& exposures,
                                std::vector<SimEvent>& events) {
  Impl& m = *impl_;
  EVPOSE_CHECK(end > m.now);
  const TimeNs t0 = m.now, t1 = m.block_end(end);
  Block block{t0, t1, exposures, m.glare(), {}, part_extents(m.prepared.scene, m.camera, m.path, t0, t1)};
  m.make_views(block);
  std::vector<float> nearest_before;
  for (const TileState& tile : m.tiles) nearest_before.push_back(tile.nearest);
  m.trace_surfaces(block.views[kGrid].T_map_cam, m.after);
  m.set_tile_speeds(t0, t1, nearest_before);
  m.pool.for_chunks(m.tiles.size(), 4, [&](std::size_t, std::size_t begin, std::size_t stop) {
    for (std::size_t k = begin; k < stop; ++k) m.integrate_tile(m.tiles[k], block);
  });
  m.collect(events);
  std::swap(m.before, m.after);
  m.now = t1;
  return t1;
}

void describe(ConfigTable& table, PixelIntegratorConfig& config) {
  table.add("step_px", config.step_px, "px", "optical flow between two samples of a tile", {0.05, 2});
  table.add("block_px", config.block_px, "px",
            "optical flow within a block, at whose ends surfaces are traced", {1, 8});
  table.add("block_s", config.block_s, "s", "longest block", {1e-4, 0.1});
  table.add("max_flow_px_s", config.max_flow_px_s, "px/s", "flights with a faster optical flow are refused",
            {1, 1e6});
  table.add("veiling_glare", config.veiling_glare, "",
            "fraction of the mean luminance of the image that the lens scatters over all of it", {0, 1});
}

}  // namespace evpose::sim
