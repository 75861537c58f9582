// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/sensors/pixel_integrator.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <mutex>

#include "evpose/core/config.h"
#include "evpose/core/parallel.h"
#include "evpose/sim/light/tile_sampler.h"
#include "evpose/sim/light/visible_triangles.h"
#include "evpose/sim/sensors/part_extent.h"
#include "evpose/sim/sensors/step_integrator.h"

namespace evpose::sim {
namespace {

// Numbers of samples that a tile may take in a block. All divide kGrid, so that few views serve all tiles.
constexpr std::array<int, 11> kCounts = {1, 2, 3, 4, 5, 6, 8, 10, 12, 15, 20};
constexpr int kGrid = 120;
constexpr double kShortestBlock_s = 2e-6;
constexpr double kMargin = 1.2;  // the flow may get faster within a block

// State of one tile in one block.
struct TileState {
  Tile tile;
  std::array<Eigen::Vector3d, 5> probe;  // rays
  std::array<Matrix23d, 5> jacobian;     // px per change of the ray
  float nearest = 0;                     // m
  double speed = 0;                      // px/s
  std::array<TileSamples, 2> samples;    // the last and the one before
  int last = 0;
  std::vector<SimEvent> events;
  PixelIntegratorCounts counts;
};

struct Block {
  TimeNs t0, t1;
  const std::vector<Exposure*>& exposures;
  float glare;
  std::array<SceneView, kGrid + 1> views;  // those that some tile uses
  std::vector<PartExtent> parts;
  // Views at the quarters of each step of the tiles that take as many samples; made by the first of them.
  mutable std::array<std::vector<StepIntegrator::QuarterViews>, kCounts.size()> quarters;
  mutable std::array<std::once_flag, kCounts.size()> have_quarters;

  const StepIntegrator::QuarterViews& quarters_of(int samples, int step) const {
    const auto number = std::find(kCounts.begin(), kCounts.end(), samples) - kCounts.begin();
    std::call_once(have_quarters[number], [&] {
      for (int n = 0; n < samples; ++n)
        quarters[number].push_back(
            StepIntegrator::quarter_views(views[n * kGrid / samples], views[(n + 1) * kGrid / samples]));
    });
    return quarters[number][step];
  }
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
  return true;
}

std::vector<Tile> cut_into_tiles(ImageSize size) {
  std::vector<Tile> tiles;
  for (int y = 0; y < size.height; y += kTilePx) {
    for (int x = 0; x < size.width; x += kTilePx)
      tiles.push_back({x, y, std::min(kTilePx, size.width - x), std::min(kTilePx, size.height - y)});
  }
  return tiles;
}

}  // namespace

struct PixelIntegrator::Impl {
  Impl(const PreparedScene& s, const Camera& c, const std::vector<PixelRay>& r, CameraPath p,
       const PixelIntegratorConfig& f, EventPixels& e, ThreadPool& t)
      : prepared(s),
        camera(c),
        rays(r),
        path(std::move(p)),
        config(f),
        pixels(e),
        pool(t),
        size(c.size()),
        triangles(s, r, size, cut_into_tiles(size)) {}

  const PreparedScene& prepared;
  const Camera& camera;
  const std::vector<PixelRay>& rays;
  CameraPath path;
  PixelIntegratorConfig config;
  EventPixels& pixels;
  ThreadPool& pool;
  ImageSize size;
  TimeNs now = 0;
  VisibleTriangles triangles;  // of the block
  std::vector<TileState> tiles;
  PixelIntegratorCounts counts;

  SceneView view_at(TimeNs t) const {
    return make_scene_view(prepared, to_seconds(t), path(to_seconds(t)).T_map_cam);
  }
  std::size_t index(int x, int y) const { return static_cast<std::size_t>(y) * size.width + x; }

  void prepare_tiles();
  void measure_depths(const SceneView& view);
  TimeNs block_end(TimeNs end);
  void make_views(Block& block) const;
  void set_tile_speeds(TimeNs t0, TimeNs t1, const std::vector<float>& nearest_before);
  float glare() const;
  TilePlan plan_tile(std::size_t k, const Block& block, int& samples) const;
  void sample_first(const SceneView& view, const Block& block);
  void integrate_tile(std::size_t k, TileSampler& sampler, const Block& block);
  void collect(TimeNs t0, std::vector<SimEvent>& events);
};

void PixelIntegrator::Impl::prepare_tiles() {
  for (const Tile& cut : triangles.tiles()) {
    TileState& tile = tiles.emplace_back();
    tile.tile = cut;
    const int right = cut.x0 + cut.width - 1, low = cut.y0 + cut.height - 1;
    const std::array<std::array<int, 2>, 5> probes = {{{cut.x0, cut.y0},
                                                       {right, cut.y0},
                                                       {cut.x0, low},
                                                       {right, low},
                                                       {(cut.x0 + right) / 2, (cut.y0 + low) / 2}}};
    for (int i = 0; i < 5; ++i) {
      tile.probe[i] = rays[index(probes[i][0], probes[i][1])].direction().cast<double>();
      EVPOSE_CHECK(camera.project(tile.probe[i], &tile.jacobian[i]));
    }
  }
}

// The nearest surface or pane of each tile.
void PixelIntegrator::Impl::measure_depths(const SceneView& view) {
  pool.for_chunks(tiles.size(), 8, [&](std::size_t, std::size_t begin, std::size_t end) {
    TileRaster raster;
    for (std::size_t k = begin; k < end; ++k) {
      raster.set_tile(rays, size, tiles[k].tile);
      raster.draw(prepared, view, triangles.of_tile(k));
      // What a pane mirrors seems to lie beyond it.
      float nearness = raster.largest_nearness();
      for (const PaneView& pane : view.panes)
        nearness = std::max(nearness, static_cast<float>(largest_nearness(pane, tiles[k].probe)));
      tiles[k].nearest = std::max(1 / nearness, static_cast<float>(kNearest_m));
    }
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
  for (const TileState& tile : tiles) {
    for (int y = 0; y < tile.tile.height; ++y) {
      const float* row = &tile.samples[tile.last].luminance[static_cast<std::size_t>(y) * kTilePx];
      for (int x = 0; x < tile.tile.width; ++x) sum += row[x];
    }
  }
  return static_cast<float>(config.veiling_glare * sum / static_cast<double>(rays.size()));
}

TilePlan PixelIntegrator::Impl::plan_tile(std::size_t k, const Block& block, int& samples) const {
  TilePlan out{tiles[k].tile, triangles.of_tile(k), {}};
  const double length_s = to_seconds(block.t1 - block.t0);
  double motion_px = tiles[k].speed * length_s;
  for (std::size_t i = 0; i < block.parts.size(); ++i) {
    if (add_part(block.parts[i], static_cast<int>(i), out))
      motion_px = std::max(motion_px, block.parts[i].speed_px_s * length_s);
  }
  const double wanted =
      std::max(motion_px / config.step_px, length_s / prepared.channels.step_s(to_seconds(block.t0)));
  samples = *std::find_if(kCounts.begin(), kCounts.end() - 1, [&](int n) { return n >= wanted - 1e-6; });
  return out;
}

void PixelIntegrator::Impl::integrate_tile(std::size_t k, TileSampler& sampler, const Block& block) {
  TileState& tile = tiles[k];
  tile.events.clear();
  tile.counts = {};
  int samples = 1;
  const TilePlan plan = plan_tile(k, block, samples);
  sampler.set_plan(plan);
  TimeNs t0 = block.t0;
  for (int n = 1; n <= samples; ++n) {
    const int from = (n - 1) * kGrid / samples, to = n * kGrid / samples;
    const TimeNs t1 = block.t0 + (block.t1 - block.t0) * to / kGrid;
    if (t1 == t0) continue;
    const TileSamples& before = tile.samples[tile.last];
    tile.last = 1 - tile.last;
    TileSamples& after = tile.samples[tile.last];
    sampler.sample(block.views[to], after);
    tile.counts.samples += static_cast<std::int64_t>(tile.tile.width) * tile.tile.height;
    tile.counts.border_samples += static_cast<std::int64_t>(after.borders.size());
    StepIntegrator step{prepared,
                        sampler,
                        pixels,
                        size,
                        plan,
                        {block.views[from], block.views[to]},
                        block.quarters_of(samples, n - 1),
                        t0,
                        t1,
                        before,
                        after,
                        block.glare,
                        block.exposures,
                        tile.events};
    step.integrate();
    tile.counts.knots += step.knots;
    t0 = t1;
  }
}

void PixelIntegrator::Impl::sample_first(const SceneView& view, const Block& block) {
  pool.for_chunks(tiles.size(), 8, [&](std::size_t, std::size_t begin, std::size_t end) {
    TileSampler sampler(prepared, rays, size);
    for (std::size_t k = begin; k < end; ++k) {
      int samples = 0;
      const TilePlan plan = plan_tile(k, block, samples);
      sampler.set_plan(plan);
      sampler.sample(view, tiles[k].samples[0]);
    }
  });
}

// Appends the events of all tiles, sorted, and adds up their counts.
void PixelIntegrator::Impl::collect(TimeNs t0, std::vector<SimEvent>& events) {
  ++counts.blocks;
  std::size_t count = 0;
  for (const TileState& tile : tiles) {
    count += tile.events.size();
    counts.samples += tile.counts.samples;
    counts.border_samples += tile.counts.border_samples;
    counts.knots += tile.counts.knots;
  }
  // Slots of about a dozen events, each sorted by itself.
  const std::size_t slots = count / 12 + 1, first = events.size();
  const auto slot_of = [&](const SimEvent& e) {
    return static_cast<std::size_t>(e.t - t0 - 1) * slots / static_cast<std::size_t>(now - t0);
  };
  std::vector<std::size_t> ends(slots + 1, first);
  for (const TileState& tile : tiles)
    for (const SimEvent& e : tile.events) ++ends[slot_of(e) + 1];
  for (std::size_t i = 0; i < slots; ++i) ends[i + 1] += ends[i] - first;
  events.resize(first + count);
  for (const TileState& tile : tiles)
    for (const SimEvent& e : tile.events) events[ends[slot_of(e)]++] = e;
  pool.for_chunks(slots, 1024, [&](std::size_t, std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const std::size_t from = i == 0 ? first : ends[i - 1];
      std::sort(events.begin() + static_cast<std::ptrdiff_t>(from),
                events.begin() + static_cast<std::ptrdiff_t>(ends[i]),
                [](const SimEvent& a, const SimEvent& b) {
                  return a.t != b.t ? a.t < b.t : a.y != b.y ? a.y < b.y : a.x < b.x;
                });
    }
  });
}

PixelIntegrator::PixelIntegrator(const PreparedScene& prepared, const Camera& camera,
                                 const std::vector<PixelRay>& rays, CameraPath path,
                                 const PixelIntegratorConfig& config, EventPixels& pixels, ThreadPool& pool)
    : impl_(std::make_unique<Impl>(prepared, camera, rays, std::move(path), config, pixels, pool)) {
  impl_->prepare_tiles();
}

PixelIntegrator::~PixelIntegrator() = default;

const PixelIntegratorCounts& PixelIntegrator::counts() const { return impl_->counts; }

void PixelIntegrator::start(TimeNs t) {
  Impl& m = *impl_;
  m.now = t;
  const SceneView view = m.view_at(t);
  m.triangles.find(view, view, m.pool);
  m.measure_depths(view);
  const std::vector<Exposure*> none;
  const TimeNs soon = t + kNsPerUs;
  m.sample_first(view,
                 {t, soon, none, 0, {}, part_extents(m.prepared.scene, m.camera, m.path, t, soon), {}, {}});
  const float glare = m.glare();
  for (const TileState& tile : m.tiles) {
    for (int y = 0; y < tile.tile.height; ++y) {
      for (int x = 0; x < tile.tile.width; ++x)
        m.pixels.start(m.index(tile.tile.x0 + x, tile.tile.y0 + y), t,
                       tile.samples[0].luminance[static_cast<std::size_t>(y) * kTilePx + x] + glare);
    }
  }
}

TimeNs PixelIntegrator::advance(TimeNs end, const std::vector<Exposure*>& exposures,
                                std::vector<SimEvent>& events) {
  Impl& m = *impl_;
  EVPOSE_CHECK(end > m.now);
  const TimeNs t0 = m.now, t1 = m.block_end(end);
  Block block{t0, t1, exposures, m.glare(), {}, part_extents(m.prepared.scene, m.camera, m.path, t0, t1),
              {}, {}};
  m.make_views(block);
  std::vector<float> nearest_before;
  for (const TileState& tile : m.tiles) nearest_before.push_back(tile.nearest);
  m.triangles.find(block.views[0], block.views[kGrid], m.pool);
  m.measure_depths(block.views[kGrid]);
  m.set_tile_speeds(t0, t1, nearest_before);
  m.pool.for_chunks(m.tiles.size(), 4, [&](std::size_t, std::size_t begin, std::size_t stop) {
    TileSampler sampler(m.prepared, m.rays, m.size);
    for (std::size_t k = begin; k < stop; ++k) m.integrate_tile(k, sampler, block);
  });
  m.now = t1;
  m.collect(t0, events);
  return t1;
}

void describe(ConfigTable& table, PixelIntegratorConfig& config) {
  table.add("step_px", config.step_px, "px", "optical flow between two samples of a tile", {0.05, 2});
  table.add("block_px", config.block_px, "px",
            "optical flow within a block, for which the triangles in view are found", {1, 8});
  table.add("block_s", config.block_s, "s", "longest block", {1e-4, 0.1});
  table.add("max_flow_px_s", config.max_flow_px_s, "px/s", "flights with a faster optical flow are refused",
            {1, 1e6});
  table.add("veiling_glare", config.veiling_glare, "",
            "fraction of the mean luminance of the image that the lens scatters over all of it", {0, 1});
}

}  // namespace evpose::sim
