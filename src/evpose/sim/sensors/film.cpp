// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/sensors/film.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <optional>

#include "evpose/core/config.h"
#include "evpose/core/parallel.h"
#include "evpose/sim/light/pixel_course.h"
#include "evpose/sim/light/tile_sampler.h"

namespace evpose::sim {
namespace {

// Numbers of samples that a tile may take in a block; all divide kGrid, so that few views serve all tiles.
constexpr std::array<int, 8> kCounts = {1, 2, 3, 4, 6, 8, 12, 16};
constexpr int kGrid = 48;
constexpr double kShortestBlock_s = 2e-6;
constexpr double kNearest_m = 0.02;
constexpr double kMargin = 1.2;  // motion may get faster within a block

// Which surface of what stands still the pixels' centres see.
struct SurfaceImage {
  std::vector<std::int32_t> group, patch;
};

struct Extent {
  int x0, y0, x1, y1;  // [x0, x1) x [y0, y1)
};

// True if all values of the extent, in both images, are the same.
bool uniform(const std::vector<std::int32_t>& a, const std::vector<std::int32_t>& b, int width,
             const Extent& e) {
  const std::int32_t first = a[static_cast<std::size_t>(e.y0) * width + e.x0];
  for (int y = e.y0; y < e.y1; ++y) {
    const std::int32_t* row_a = &a[static_cast<std::size_t>(y) * width];
    const std::int32_t* row_b = &b[static_cast<std::size_t>(y) * width];
    bool same = true;
    for (int x = e.x0; x < e.x1; ++x) same = same && row_a[x] == first && row_b[x] == first;
    if (!same) return false;
  }
  return true;
}

}  // namespace

struct Film::Impl {
  struct Work {  // of one tile in one block
    Tile tile;
    std::array<Eigen::Vector3d, 5> probe;  // rays
    std::array<Matrix23d, 5> jacobian;     // px per change of the ray
    float nearest = 0;                     // m
    double speed = 0;                      // px/s
    std::vector<SimEvent> events;
    FilmCounts counts;
  };
  struct Mover {
    bool seen = false;
    double speed = 0;  // px/s
    Extent extent{};
  };
  struct Block {
    TimeNs t0, t1;
    const std::vector<Exposure*>& exposures;
    float glare;
    std::array<View, kGrid + 1> views;  // those that some tile uses
    std::vector<Mover> movers;
  };

  Impl(const Stage& s, const Camera& c, const std::vector<PixelRay>& r, CameraPath p, const FilmConfig& f,
       EventPixels& e, ThreadPool& t)
      : stage(s), camera(c), rays(r), path(std::move(p)), config(f), pixels(e), pool(t), size(c.size()) {}

  const Stage& stage;
  const Camera& camera;
  const std::vector<PixelRay>& rays;
  CameraPath path;
  FilmConfig config;
  EventPixels& pixels;
  ThreadPool& pool;
  ImageSize size;
  TimeNs now = 0;
  std::vector<Work> work;
  std::vector<PixelSample> last;  // of every pixel, row by row
  SurfaceImage before, after;     // at the block's ends
  FilmCounts counts;

  View view_at(TimeNs t) const { return make_view(stage, to_seconds(t), path(to_seconds(t)).T_map_cam); }
  std::size_t index(int x, int y) const { return static_cast<std::size_t>(y) * size.width + x; }

  void cut_into_tiles();
  void look(const Pose& T_map_cam, SurfaceImage& image);
  double tile_speed(const Work& tile, const CameraMotion& motion) const;
  Mover mover_at(std::size_t part, TimeNs t, double ahead_s) const;
  TimeNs block_end(TimeNs end);
  std::vector<Mover> movers(TimeNs t0, TimeNs t1) const;
  float glare() const;
  TilePlan plan(const Work& tile, const Block& block, int& samples) const;
  void classify(const Work& tile, int reach, TilePlan& plan) const;
  void run(Work& tile, const Block& block);
  void follow(Work& tile, const Block& block, const CourseContext& context, const Course& course,
              std::size_t pixel);
  void step(Work& tile, const Block& block, const TilePlan& plan, const CourseContext& context,
            const TileSamples& samples);
};

void Film::Impl::cut_into_tiles() {
  for (int y = 0; y < size.height; y += kTilePx) {
    for (int x = 0; x < size.width; x += kTilePx) {
      Work tile;
      tile.tile = {x, y, std::min(kTilePx, size.width - x), std::min(kTilePx, size.height - y)};
      const int right = x + tile.tile.width - 1, low = y + tile.tile.height - 1;
      const std::array<std::array<int, 2>, 5> places = {
          {{x, y}, {right, y}, {x, low}, {right, low}, {(x + right) / 2, (y + low) / 2}}};
      for (int i = 0; i < 5; ++i) {
        tile.probe[i] = rays[index(places[i][0], places[i][1])].direction().cast<double>();
        EVPOSE_CHECK(camera.project(tile.probe[i], &tile.jacobian[i]));
      }
      work.push_back(std::move(tile));
    }
  }
}

void Film::Impl::look(const Pose& T_map_cam, SurfaceImage& image) {
  const std::size_t n = rays.size();
  image.group.resize(n);
  image.patch.resize(n);
  const Eigen::Matrix3d R = T_map_cam.rotation();
  pool.for_chunks(work.size(), 8, [&](std::size_t, std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      const Tile& tile = work[k].tile;
      float nearest = std::numeric_limits<float>::infinity();
      std::array<Eigen::Vector3f, kTilePx> ways;
      std::array<RayCaster::BatchHit, kTilePx> hits;
      for (int y = tile.y0; y < tile.y0 + tile.height; ++y) {
        const std::size_t first = index(tile.x0, y);
        for (int x = 0; x < tile.width; ++x)
          ways[x] = (R * rays[first + x].direction().cast<double>()).cast<float>();
        stage.rays.trace_batch(T_map_cam.p, {ways.data(), static_cast<std::size_t>(tile.width)}, hits);
        for (int x = 0; x < tile.width; ++x) {
          const std::size_t i = first + x;
          const bool met = hits[x].triangle != RayCaster::kNoTriangle;
          image.patch[i] = met ? stage.still.patch_of[hits[x].triangle] : -1;
          image.group[i] = met ? stage.still.patches[image.patch[i]].group : kSky;
          nearest = std::min(nearest, hits[x].distance);
        }
      }
      work[k].nearest = std::max(nearest, static_cast<float>(kNearest_m));
    }
  });
}

// No pixel of the tile moves faster, in px/s: motion grows or falls steadily with 1 / depth.
double Film::Impl::tile_speed(const Work& tile, const CameraMotion& motion) const {
  double fastest = 0;
  for (int i = 0; i < 5; ++i) {
    const Eigen::Vector2d turn = tile.jacobian[i] * -motion.rate.cross(tile.probe[i]);
    const Eigen::Vector2d shift = tile.jacobian[i] * (-motion.velocity / tile.nearest);
    fastest = std::max({fastest, turn.norm(), (turn + shift).norm()});
  }
  return fastest;
}

// Where a moving part is in the image, and how fast, from the corners of the box around it.
Film::Impl::Mover Film::Impl::mover_at(std::size_t part, TimeNs t, double ahead_s) const {
  const MovingPart& moving = stage.scene.moving[part];
  Mover out;
  if (moving.mesh.vertices.empty()) return out;
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3f& v : moving.mesh.vertices) box.extend(v.cast<double>());
  const auto T_cam_part = [&](double t_s) { return path(t_s).T_map_cam.inverse() * moving.T_map_part(t_s); };
  const Pose here = T_cam_part(to_seconds(t)), there = T_cam_part(to_seconds(t) + ahead_s);
  Eigen::AlignedBox2d extent;
  int behind = 0;
  for (int i = 0; i < 8; ++i) {
    const Eigen::Vector3d corner = box.corner(static_cast<Eigen::AlignedBox3d::CornerType>(i));
    const Eigen::Vector3d p = here * corner, q = there * corner;
    if (p.z() < kNearest_m || q.z() < kNearest_m) {
      ++behind;
      continue;
    }
    const auto from = camera.project(p), to = camera.project(q);
    if (!from || !to) {
      ++behind;
      continue;
    }
    extent.extend(*from);
    extent.extend(*to);
    out.speed = std::max(out.speed, (*to - *from).norm() / ahead_s);
  }
  if (behind == 8) return out;
  if (behind > 0)
    extent = Eigen::AlignedBox2d(Eigen::Vector2d(0, 0), Eigen::Vector2d(size.width, size.height));
  // Corners beside the camera race to infinity unseen. What is in view goes no faster than the part's centre
  // and its turning, over the distance, at the image's corner.
  const double nearest = std::max(kNearest_m, std::sqrt(box.squaredExteriorDistance(here.inverse().p)));
  const double way = (there * box.center() - here * box.center()).norm();
  const double turned = 0.5 * box.diagonal().norm() * here.q.angularDistance(there.q);
  const double f = camera.focal_px(), wide = 0.5 * std::hypot(size.width, size.height) / f;
  out.speed = std::min(out.speed, f * (1 + wide * wide) * (way + turned) / (nearest * ahead_s));
  out.extent = {std::max(0, static_cast<int>(std::floor(extent.min().x())) - 2),
                std::max(0, static_cast<int>(std::floor(extent.min().y())) - 2),
                std::min(size.width, static_cast<int>(std::ceil(extent.max().x())) + 3),
                std::min(size.height, static_cast<int>(std::ceil(extent.max().y())) + 3)};
  out.seen = out.extent.x0 < out.extent.x1 && out.extent.y0 < out.extent.y1;
  return out;
}

TimeNs Film::Impl::block_end(TimeNs end) {
  const double t_s = to_seconds(now);
  const CameraMotion motion = path(t_s);
  double fastest = 0;
  for (Work& tile : work) fastest = std::max(fastest, tile_speed(tile, motion));
  for (std::size_t i = 0; i < stage.scene.moving.size(); ++i) {
    const Mover mover = mover_at(i, now, 1e-4);
    if (mover.seen) fastest = std::max(fastest, mover.speed);
  }
  double length_s = std::min(config.block_s, config.block_px / (kMargin * fastest + 1e-9));
  length_s = std::min(length_s, kCounts.back() * stage.channels.step_s(t_s));
  length_s = std::max(length_s, kShortestBlock_s);
  // Whole microseconds, many of them: the times of a block are the same however the recording is cut.
  const TimeNs length = std::max<TimeNs>(1, static_cast<TimeNs>(length_s * 1e6)) * kNsPerUs;
  const double next_switch_s = stage.channels.next_switch_s(t_s);
  if (next_switch_s < to_seconds(end)) end = std::min(end, std::max(from_seconds(next_switch_s), now + 1));
  return std::min(end, now + length);
}

std::vector<Film::Impl::Mover> Film::Impl::movers(TimeNs t0, TimeNs t1) const {
  constexpr int kLooks = 4;
  std::vector<Mover> all;
  for (std::size_t i = 0; i < stage.scene.moving.size(); ++i) {
    Mover sum;
    const double ahead_s = to_seconds(t1 - t0) / kLooks;
    for (int k = 0; k < kLooks; ++k) {
      const Mover one = mover_at(i, t0 + (t1 - t0) * k / kLooks, ahead_s);
      if (!one.seen) continue;
      sum.extent =
          sum.seen ? Extent{std::min(sum.extent.x0, one.extent.x0), std::min(sum.extent.y0, one.extent.y0),
                            std::max(sum.extent.x1, one.extent.x1), std::max(sum.extent.y1, one.extent.y1)}
                   : one.extent;
      sum.seen = true;
      sum.speed = std::max(sum.speed, one.speed);
    }
    all.push_back(sum);
  }
  return all;
}

float Film::Impl::glare() const {
  double sum = 0;
  for (const PixelSample& sample : last) sum += sample.luminance;
  return static_cast<float>(config.veiling_glare * sum / static_cast<double>(last.size()));
}

// What kind each pixel is of, when nothing moves by more than `reach` pixels.
void Film::Impl::classify(const Work& work_tile, int reach, TilePlan& plan) const {
  const Tile& tile = work_tile.tile;
  const Extent around{tile.x0 - reach, tile.y0 - reach, tile.x0 + tile.width + reach,
                      tile.y0 + tile.height + reach};
  const auto inside = [&](const Extent& e) {
    return e.x0 >= 0 && e.y0 >= 0 && e.x1 <= size.width && e.y1 <= size.height;
  };
  const bool all_flat = inside(around) && uniform(before.patch, after.patch, size.width, around);
  for (int y = 0; y < tile.height; ++y) {
    for (int x = 0; x < tile.width; ++x) {
      const int column = tile.x0 + x, row = tile.y0 + y;
      const std::size_t i = static_cast<std::size_t>(y) * kTilePx + x;
      plan.patch[i] = before.patch[index(column, row)];
      if (all_flat) {
        plan.pixel[i] = PixelClass::flat;
        continue;
      }
      const Extent window{column - reach, row - reach, column + reach + 1, row + reach + 1};
      if (!inside(window) || !uniform(before.group, after.group, size.width, window))
        plan.pixel[i] = PixelClass::open;
      else
        plan.pixel[i] =
            uniform(before.patch, after.patch, size.width, window) ? PixelClass::flat : PixelClass::smooth;
    }
  }
}

TilePlan Film::Impl::plan(const Work& tile, const Block& block, int& samples) const {
  TilePlan out;
  out.tile = tile.tile;
  const double length_s = to_seconds(block.t1 - block.t0);
  double motion_px = tile.speed * length_s;
  classify(tile, 1 + static_cast<int>(std::ceil(motion_px)), out);
  for (std::size_t i = 0; i < block.movers.size(); ++i) {
    const Mover& mover = block.movers[i];
    const Extent& e = mover.extent;
    if (!mover.seen || e.x0 >= tile.tile.x0 + tile.tile.width || e.x1 <= tile.tile.x0 ||
        e.y0 >= tile.tile.y0 + tile.tile.height || e.y1 <= tile.tile.y0)
      continue;
    out.movers.push_back({static_cast<int>(i), e.x0, e.y0, e.x1, e.y1});
    motion_px = std::max(motion_px, mover.speed * length_s);
    for (int y = 0; y < tile.tile.height; ++y) {
      for (int x = 0; x < tile.tile.width; ++x) {
        const int column = tile.tile.x0 + x, row = tile.tile.y0 + y;
        if (column >= e.x0 && column < e.x1 && row >= e.y0 && row < e.y1)
          out.pixel[static_cast<std::size_t>(y) * kTilePx + x] = PixelClass::open;
      }
    }
  }
  const double wanted =
      std::max(motion_px / config.step_px, length_s / stage.channels.step_s(to_seconds(block.t0)));
  samples = *std::find_if(kCounts.begin(), kCounts.end() - 1, [&](int n) { return n >= wanted - 1e-6; });
  return out;
}

// Takes a pixel along its course.
void Film::Impl::follow(Work& tile, const Block& block, const CourseContext& context, const Course& course,
                        std::size_t pixel) {
  const TimeNs t0 = context.t0, t1 = context.t1;
  TimeNs from_t = t0;
  for (int k = 1; k < course.knots; ++k) {
    const TimeNs to_t =
        k + 1 == course.knots ? t1 : t0 + static_cast<TimeNs>(course.time[k] * static_cast<float>(t1 - t0));
    if (to_t <= from_t) continue;
    pixels.advance(pixel, from_t, to_t, course.luminance[k - 1] + block.glare,
                   course.luminance[k] + block.glare, tile.events);
    from_t = to_t;
  }
  tile.counts.knots += course.knots - 2;
  const double length_ns = static_cast<double>(t1 - t0);
  for (Exposure* exposure : block.exposures) {
    const TimeNs open = std::max(t0, exposure->open), close = std::min(t1, exposure->close);
    if (open >= close) continue;
    const float seen = course.integral(static_cast<double>(open - t0) / length_ns,
                                       static_cast<double>(close - t0) / length_ns);
    exposure->sum[pixel] += static_cast<float>(to_seconds(t1 - t0)) * seen +
                            static_cast<float>(to_seconds(close - open)) * block.glare;
  }
}

// From the sample before to this one.
void Film::Impl::step(Work& tile, const Block& block, const TilePlan& plan, const CourseContext& context,
                      const TileSamples& samples) {
  for (int y = 0; y < plan.tile.height; ++y) {
    for (int x = 0; x < plan.tile.width; ++x) {
      const std::size_t in_tile = static_cast<std::size_t>(y) * kTilePx + x;
      const int column = plan.tile.x0 + x, row = plan.tile.y0 + y;
      const std::size_t i = index(column, row);
      const PixelSample& sample = samples[in_tile];
      const std::size_t first_event = tile.events.size();
      if (block.exposures.empty() && nearly_same(last[i], sample)) {
        pixels.advance(i, context.t0, context.t1, last[i].luminance + block.glare,
                       sample.luminance + block.glare, tile.events);
      } else {
        follow(tile, block, context, pixel_course(context, last[i], sample, plan, x, y), i);
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

void Film::Impl::run(Work& tile, const Block& block) {
  int samples = 1;
  const TilePlan tile_plan = plan(tile, block, samples);
  TileSampler sampler(stage, rays, size);
  TileSamples now_seen;
  TimeNs t0 = block.t0;
  for (int k = 1; k <= samples; ++k) {
    const int from = (k - 1) * kGrid / samples, to = k * kGrid / samples;
    const TimeNs t1 = block.t0 + (block.t1 - block.t0) * to / kGrid;
    if (t1 == t0) continue;
    sampler.sample(block.views[to], tile_plan, now_seen);
    const CourseContext context{stage, sampler, block.views[from], block.views[to], t0, t1};
    step(tile, block, tile_plan, context, now_seen);
    t0 = t1;
  }
  tile.counts.samples += samples * static_cast<std::int64_t>(tile.tile.width) * tile.tile.height;
  tile.counts.open_samples +=
      samples * std::count(tile_plan.pixel.begin(), tile_plan.pixel.end(), PixelClass::open);
}

Film::Film(const Stage& stage, const Camera& camera, const std::vector<PixelRay>& rays, CameraPath path,
           const FilmConfig& config, EventPixels& pixels, ThreadPool& pool)
    : impl_(std::make_unique<Impl>(stage, camera, rays, std::move(path), config, pixels, pool)) {
  impl_->cut_into_tiles();
}

Film::~Film() = default;

const FilmCounts& Film::counts() const { return impl_->counts; }

void Film::start(TimeNs t) {
  Impl& f = *impl_;
  f.now = t;
  const View view = f.view_at(t);
  f.look(view.T_map_cam, f.before);
  f.after = f.before;
  f.last.resize(f.rays.size());
  const std::vector<Exposure*> none;
  Impl::Block block{t, t + kNsPerUs, none, 0, {}, f.movers(t, t + kNsPerUs)};
  f.pool.for_chunks(f.work.size(), 8, [&](std::size_t, std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      int samples = 0;
      TileSampler sampler(f.stage, f.rays, f.size);
      TileSamples seen;
      const TilePlan plan = f.plan(f.work[k], block, samples);
      sampler.sample(view, plan, seen);
      for (int y = 0; y < plan.tile.height; ++y) {
        for (int x = 0; x < plan.tile.width; ++x)
          f.last[f.index(plan.tile.x0 + x, plan.tile.y0 + y)] =
              seen[static_cast<std::size_t>(y) * kTilePx + x];
      }
    }
  });
  const float glare = f.glare();
  for (std::size_t i = 0; i < f.last.size(); ++i) f.pixels.start(i, t, f.last[i].luminance + glare);
}

TimeNs Film::advance(TimeNs end, const std::vector<Exposure*>& exposures, std::vector<SimEvent>& events) {
  Impl& f = *impl_;
  EVPOSE_CHECK(end > f.now);
  const TimeNs t0 = f.now, t1 = f.block_end(end);
  Impl::Block block{t0, t1, exposures, f.glare(), {}, f.movers(t0, t1)};
  for (const int n : kCounts) {
    for (int k = 0; k <= n; ++k) {
      View& view = block.views[k * kGrid / n];
      if (view.light.empty()) view = f.view_at(t0 + (t1 - t0) * (k * kGrid / n) / kGrid);
    }
  }
  std::vector<float> nearest;
  for (const Impl::Work& tile : f.work) nearest.push_back(tile.nearest);
  f.look(block.views[kGrid].T_map_cam, f.after);
  const std::array<CameraMotion, 3> motion = {
      f.path(to_seconds(t0)), f.path(0.5 * (to_seconds(t0) + to_seconds(t1))), f.path(to_seconds(t1))};
  for (std::size_t k = 0; k < f.work.size(); ++k) {
    Impl::Work& tile = f.work[k];
    const float nearest_after = tile.nearest;
    tile.nearest = std::min(tile.nearest, nearest[k]);
    tile.speed = 0;
    for (const CameraMotion& m : motion) tile.speed = std::max(tile.speed, f.tile_speed(tile, m));
    tile.nearest = nearest_after;
    tile.events.clear();
    tile.counts = {};
  }
  f.pool.for_chunks(f.work.size(), 4, [&](std::size_t, std::size_t begin, std::size_t stop) {
    for (std::size_t k = begin; k < stop; ++k) f.run(f.work[k], block);
  });
  const std::size_t first = events.size();
  ++f.counts.blocks;
  for (const Impl::Work& tile : f.work) {
    events.insert(events.end(), tile.events.begin(), tile.events.end());
    f.counts.samples += tile.counts.samples;
    f.counts.open_samples += tile.counts.open_samples;
    f.counts.knots += tile.counts.knots;
  }
  std::sort(events.begin() + static_cast<std::ptrdiff_t>(first), events.end(),
            [](const SimEvent& a, const SimEvent& b) {
              return a.t != b.t ? a.t < b.t : a.y != b.y ? a.y < b.y : a.x < b.x;
            });
  std::swap(f.before, f.after);
  f.now = t1;
  return t1;
}

void describe(ConfigTable& table, FilmConfig& config) {
  table.add("step_px", config.step_px, "px", "motion of the picture between two samples", {0.05, 2});
  table.add("block_px", config.block_px, "px", "motion between two looks at which surface is where", {1, 8});
  table.add("block_s", config.block_s, "s", "longest time between two such looks", {1e-4, 0.1});
  table.add("fastest_px_s", config.fastest_px_s, "px/s", "flights that move the picture faster are refused",
            {1, 1e6});
  table.add("veiling_glare", config.veiling_glare, "",
            "share of the picture's mean luminance that the lens scatters over all of it", {0, 1});
}

}  // namespace evpose::sim
