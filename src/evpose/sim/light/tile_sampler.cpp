// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/light/tile_sampler.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace evpose::sim {
namespace {

constexpr std::uint8_t kPlanes = 3;  // PixelSample::edge
constexpr int kScanLines = 4;
constexpr int kBisections = 5;  // of half a pixel: to 1/128

}  // namespace

Border border_of(const PreparedScene& prepared, const SceneView& view, const PixelSample& sample) {
  if (sample.edge == kPlanes) {
    const PatchView a = make_patch_view(view, prepared.still.patches[sample.a], -1),
                    b = make_patch_view(view, prepared.still.patches[sample.b], -1);
    // The plane through the camera and the line where the two planes meet.
    const Eigen::Vector3d through = static_cast<double>(b.reach) * a.normal.cast<double>() -
                                    static_cast<double>(a.reach) * b.normal.cast<double>();
    return {through};
  }
  const Mesh& mesh = prepared.mesh_of(sample.edge_part);
  const Mesh::Corners& corners = mesh.triangles[sample.a];
  const Pose& T_part_cam = sample.edge_part < 0 ? view.T_map_cam : view.T_part_cam[sample.edge_part];
  const Eigen::Vector3d p = mesh.vertices[corners[sample.edge]].cast<double>() - T_part_cam.p;
  const Eigen::Vector3d q = mesh.vertices[corners[(sample.edge + 1) % 3]].cast<double>() - T_part_cam.p;
  return {T_part_cam.q.conjugate() * p.cross(q)};
}

TileSampler::Hit TileSampler::hit_of(std::uint32_t triangle, float depth, int part) const {
  Hit hit;
  const PartSurfaces& surfaces = prepared_.surfaces_of(part);
  hit.patch = surfaces.patch_of[triangle];
  hit.group = surfaces.patches[hit.patch].group;
  hit.part = part;
  hit.triangle = triangle;
  hit.depth = depth;
  return hit;
}

// Moving parts that may cover the pixel.
void TileSampler::find_movers(int x, int y) {
  movers_.clear();
  const int column = plan_->tile.x0 + x, row = plan_->tile.y0 + y;
  for (const TilePlan::Mover& m : plan_->movers) {
    if (column >= m.x0 && column < m.x1 && row >= m.y0 && row < m.y1) movers_.push_back(m.part);
  }
}

void TileSampler::add_movers(const PixelRay& ray, float x, float y, Hit& hit) const {
  const Eigen::Vector3d in_camera = ray.direction(x, y).cast<double>();
  for (const int part : movers_) {
    const Pose& T_part_cam = view_->T_part_cam[part];
    const float far = hit.group == kSky ? std::numeric_limits<float>::infinity() : hit.depth;
    const auto closer = prepared_.rays.trace_part(part, T_part_cam.p, T_part_cam.q * in_camera, 0, far);
    if (closer) hit = hit_of(closer->triangle, closer->distance, part);
  }
}

TileSampler::Hit TileSampler::trace(const PixelRay& ray, float x, float y) const {
  const auto found =
      prepared_.rays.trace(view_->T_map_cam.p, view_->R_map_cam * ray.direction(x, y).cast<double>());
  Hit hit = found ? hit_of(found->triangle, found->distance, -1) : Hit{};
  add_movers(ray, x, y, hit);
  hit.at = {x, y};
  return hit;
}

// The rays of one sample of a tile.
struct TileSampler::Batch {
  static constexpr std::size_t kMost = static_cast<std::size_t>(kCorners) * kCorners;
  std::size_t n = 0;
  std::array<Eigen::Vector3f, kMost> directions;
  std::array<std::uint16_t, kMost> slots;
  std::array<RayCaster::BatchHit, kMost> hits;

  void add(std::size_t slot, const Eigen::Matrix3d& R_map_cam, const Eigen::Vector3f& in_camera) {
    directions[n] = (R_map_cam * in_camera.cast<double>()).cast<float>();
    slots[n++] = static_cast<std::uint16_t>(slot);
  }
};

void TileSampler::trace_centres() {
  Batch batch;
  const Tile& tile = plan_->tile;
  for (int y = 0; y < tile.height; ++y) {
    for (int x = 0; x < tile.width; ++x) {
      const std::size_t i = static_cast<std::size_t>(y) * kTilePx + x;
      if (plan_->pixel[i] != PixelClass::flat) {
        batch.add(i, view_->R_map_cam, ray(tile.x0 + x, tile.y0 + y).direction());
      } else {
        centres_[i] = {};
        if (plan_->patch[i] >= 0) centres_[i].group = prepared_.still.patches[plan_->patch[i]].group;
      }
    }
  }
  prepared_.rays.trace_batch(view_->T_map_cam.p, {batch.directions.data(), batch.n}, batch.hits);
  for (std::size_t k = 0; k < batch.n; ++k) {
    const std::size_t i = batch.slots[k];
    const RayCaster::BatchHit& found = batch.hits[k];
    Hit& hit = centres_[i];
    hit = found.triangle == RayCaster::kNoTriangle ? Hit{} : hit_of(found.triangle, found.distance, -1);
    const int x = static_cast<int>(i % kTilePx), y = static_cast<int>(i / kTilePx);
    find_movers(x, y);
    if (!movers_.empty()) add_movers(ray(tile.x0 + x, tile.y0 + y), 0, 0, hit);
  }
}

// True if a neighbouring pixel shows another group, or may do so: neighbours in other tiles are unknown.
bool TileSampler::near_border(int x, int y) const {
  const Tile& tile = plan_->tile;
  if (x == 0 || y == 0 || x + 1 == tile.width || y + 1 == tile.height) return true;
  const std::size_t i = static_cast<std::size_t>(y) * kTilePx + x;
  for (const std::size_t j : {i - kTilePx - 1, i - kTilePx, i - kTilePx + 1, i - 1, i + 1, i + kTilePx - 1,
                              i + kTilePx, i + kTilePx + 1}) {
    if (centres_[j].group != centres_[i].group) return true;
  }
  return false;
}

void TileSampler::trace_corners() {
  Batch batch;
  std::array<bool, Batch::kMost> wanted{};
  const Tile& tile = plan_->tile;
  for (int y = 0; y < tile.height; ++y) {
    for (int x = 0; x < tile.width; ++x) {
      const std::size_t i = static_cast<std::size_t>(y) * kTilePx + x;
      at_border_[i] = plan_->pixel[i] == PixelClass::mixed && near_border(x, y);
      if (!at_border_[i]) continue;
      const std::size_t c = static_cast<std::size_t>(y) * kCorners + x;
      wanted[c] = wanted[c + 1] = wanted[c + kCorners] = wanted[c + kCorners + 1] = true;
    }
  }
  // A corner is the upper left one of its pixel, or at the end of the tile a right or lower one of the last
  // pixel.
  const auto pixel_of = [&](std::size_t c) {
    return std::array<int, 2>{std::min(static_cast<int>(c % kCorners), tile.width - 1),
                              std::min(static_cast<int>(c / kCorners), tile.height - 1)};
  };
  const auto offset_of = [&](std::size_t c, const std::array<int, 2>& pixel) {
    return Eigen::Vector2f(static_cast<float>(static_cast<int>(c % kCorners) - pixel[0]) - 0.5F,
                           static_cast<float>(static_cast<int>(c / kCorners) - pixel[1]) - 0.5F);
  };
  for (std::size_t c = 0; c < wanted.size(); ++c) {
    if (!wanted[c]) continue;
    const auto pixel = pixel_of(c);
    const Eigen::Vector2f at = offset_of(c, pixel);
    batch.add(c, view_->R_map_cam, ray(tile.x0 + pixel[0], tile.y0 + pixel[1]).direction(at.x(), at.y()));
  }
  prepared_.rays.trace_batch(view_->T_map_cam.p, {batch.directions.data(), batch.n}, batch.hits);
  for (std::size_t k = 0; k < batch.n; ++k) {
    const std::size_t c = batch.slots[k];
    const RayCaster::BatchHit& found = batch.hits[k];
    Hit& hit = corners_[c];
    hit = found.triangle == RayCaster::kNoTriangle ? Hit{} : hit_of(found.triangle, found.distance, -1);
    const auto pixel = pixel_of(c);
    find_movers(pixel[0], pixel[1]);
    if (movers_.empty()) continue;
    const Eigen::Vector2f at = offset_of(c, pixel);
    add_movers(ray(tile.x0 + pixel[0], tile.y0 + pixel[1]), at.x(), at.y(), hit);
  }
}

// Hits of the centre and the corners of the pixel, corners row by row.
std::array<TileSampler::Hit, 5> TileSampler::centre_and_corners(int x, int y) const {
  const std::size_t c = static_cast<std::size_t>(y) * kCorners + x;
  std::array<Hit, 5> hits{centres_[static_cast<std::size_t>(y) * kTilePx + x], corners_[c], corners_[c + 1],
                          corners_[c + kCorners], corners_[c + kCorners + 1]};
  constexpr std::array<float, 5> kX = {0, -0.5F, 0.5F, -0.5F, 0.5F}, kY = {0, -0.5F, -0.5F, 0.5F, 0.5F};
  for (int i = 0; i < 5; ++i) hits[i].at = {kX[i], kY[i]};
  return hits;
}

const PatchView& TileSampler::patch_view(int part, std::int32_t patch) {
  const Patch* wanted = &prepared_.surfaces_of(part).patches[patch];
  if (last_view_ < patch_views_.size() && patch_views_[last_view_].patch == wanted)
    return patch_views_[last_view_];
  for (last_view_ = 0; last_view_ < patch_views_.size(); ++last_view_) {
    if (patch_views_[last_view_].patch == wanted) return patch_views_[last_view_];
  }
  patch_views_.push_back(make_patch_view(*view_, *wanted, part));
  return patch_views_.back();
}

float TileSampler::shade(const Hit& hit, const PixelRay& ray, float x, float y) {
  if (hit.group == kSky) return static_cast<float>(prepared_.scene.sky_cd_m2);
  return luminance(prepared_, *view_, patch_view(hit.part, hit.patch), ray, x, y);
}

void TileSampler::copy_hit(const Hit& hit, PixelSample& out) const {
  out.group = hit.group;
  out.part = static_cast<std::int8_t>(hit.part);
  if (hit.group != kSky)
    out.object = static_cast<std::uint16_t>(prepared_.surfaces_of(hit.part).patches[hit.patch].object);
}

// True if each of the two groups is on one side of the border.
bool TileSampler::separates(const Border& border, const PixelRay& ray, const std::array<Hit, 5>& hits,
                            PixelSample& out) const {
  const float level = border.level(ray);
  const Eigen::Vector2f slope = border.slope(ray);
  bool above = false, first = true;
  for (const Hit& hit : hits) {
    const float value = level + slope.dot(hit.at);
    const bool side = (value > 0) == (hit.group == out.group);
    if (first) above = side;
    if (side != above) return false;
    first = false;
  }
  out.group_above = above;
  return true;
}

// Finds the line that separates two groups: an edge of a triangle that was hit, nearest triangle first, or
// the intersection of two planes.
bool TileSampler::fit_border(const PixelRay& ray, const std::array<Hit, 5>& hits, PixelSample& out) {
  std::array<const Hit*, 5> by_depth{};
  for (int i = 0; i < 5; ++i) by_depth[i] = &hits[i];
  std::stable_sort(by_depth.begin(), by_depth.end(), [](const Hit* a, const Hit* b) {
    return (a->group == kSky ? 1e30F : a->depth) < (b->group == kSky ? 1e30F : b->depth);
  });
  for (int i = 0; i < 5; ++i) {
    const Hit& hit = *by_depth[i];
    if (hit.group == kSky) break;
    const bool seen = std::any_of(by_depth.begin(), by_depth.begin() + i, [&](const Hit* h) {
      return h->part == hit.part && h->triangle == hit.triangle;
    });
    if (seen) continue;
    const PartSurfaces& surfaces = prepared_.surfaces_of(hit.part);
    for (std::uint8_t edge = 0; edge < 3; ++edge) {
      if (!(surfaces.edges[hit.triangle] >> edge & 1)) continue;
      out.edge = edge;
      out.edge_part = static_cast<std::int8_t>(hit.part);
      out.a = hit.triangle;
      if (separates(border_of(prepared_, *view_, out), ray, hits, out)) return true;
    }
  }
  const Hit& one = hits[0];
  const auto two = std::find_if(hits.begin(), hits.end(), [&](const Hit& h) { return h.group != one.group; });
  if (one.part >= 0 || two->part >= 0 || one.group == kSky || two->group == kSky) return false;
  out.edge = kPlanes;
  out.a = static_cast<std::uint32_t>(one.patch);
  out.b = static_cast<std::uint32_t>(two->patch);
  return separates(border_of(prepared_, *view_, out), ray, hits, out);
}

// Mean luminance of the pixel, with the borders found by bisection along scan lines.
float TileSampler::scan_lines_luminance(const PixelRay& ray, const std::array<Hit, 5>& hits) {
  // Scan lines run across the borders.
  const bool across_columns = hits[1].group != hits[2].group || hits[3].group != hits[4].group ||
                              (hits[1].group == hits[3].group && hits[2].group == hits[4].group);
  float sum = 0;
  for (int line = 0; line < kScanLines; ++line) {
    const float fixed = (static_cast<float>(line) + 0.5F) / kScanLines - 0.5F;
    const auto at = [&](float along) {
      return across_columns ? trace(ray, along, fixed) : trace(ray, fixed, along);
    };
    const auto add = [&](const Hit& hit, float from, float to) {
      const float middle = 0.5F * (from + to);
      sum += (to - from) * shade(hit, ray, across_columns ? middle : fixed, across_columns ? fixed : middle);
    };
    Hit left = at(-0.5F);
    float from = -0.5F;
    for (const float end : {0.0F, 0.5F}) {
      const Hit right = at(end);
      if (right.group != left.group) {
        float low = end - 0.5F, high = end;
        for (int k = 0; k < kBisections; ++k) {
          const float middle = 0.5F * (low + high);
          (at(middle).group == left.group ? low : high) = middle;
        }
        const float border = 0.5F * (low + high);
        add(left, from, border);
        from = border;
        left = right;
      }
    }
    add(left, from, 0.5F);
  }
  return sum / kScanLines;
}

// True if depth or normal change between two hits. A step of less than kPrint_m is a print on a wall.
bool TileSampler::is_geometric_edge(const Hit& a, const Hit& b, const PixelRay& ray) const {
  constexpr double kSameNormal = 0.9998, kPrint_m = 2e-3;
  if (a.group == b.group) return false;
  if (a.group == kSky || b.group == kSky || a.part != b.part) return true;
  const Patch &p = prepared_.surfaces_of(a.part).patches[a.patch],
              &q = prepared_.surfaces_of(b.part).patches[b.patch];
  if (p.surface == q.surface) return false;
  if (p.normal.dot(q.normal) < kSameNormal) return true;
  // Distance of the point of b from the plane of a.
  const Pose& T_part_cam = a.part < 0 ? view_->T_map_cam : view_->T_part_cam[a.part];
  const Eigen::Vector3d point = T_part_cam * (b.depth * ray.direction(b.at.x(), b.at.y())).cast<double>();
  return std::abs(p.normal.dot(point) + p.offset) > kPrint_m;
}

void TileSampler::sample_mixed(int x, int y, PixelSample& out) {
  const std::size_t i = static_cast<std::size_t>(y) * kTilePx + x;
  if (at_border_[i]) {
    sample_border(x, y, out);
    return;
  }
  copy_hit(centres_[i], out);
  out.moving = centres_[i].part >= 0;
  out.luminance = shade(centres_[i], ray(plan_->tile.x0 + x, plan_->tile.y0 + y), 0, 0);
}

void TileSampler::sample_border(int x, int y, PixelSample& out) {
  const PixelRay& r = ray(plan_->tile.x0 + x, plan_->tile.y0 + y);
  find_movers(x, y);
  const std::array<Hit, 5> hits = centre_and_corners(x, y);
  std::int32_t other = kNone;
  for (int i = 0; i < 5; ++i) {
    out.moving = out.moving || hits[i].part >= 0;
    if (hits[i].group == hits[0].group || hits[i].group == other) continue;
    other = other == kNone ? hits[i].group : kMany;
  }
  copy_hit(hits[0], out);
  if (other == kNone) {
    out.luminance = shade(hits[0], r, 0, 0);
    return;
  }
  for (const Hit& hit : hits) out.outline = out.outline || is_geometric_edge(hits[0], hit, r);
  out.other = other;
  if (other == kMany || !fit_border(r, hits, out)) {
    out.other = kMany;
    out.luminance = scan_lines_luminance(r, hits);
    return;
  }
  // Luminance of each group, shaded near the mean of its hits.
  const auto own = [&](std::int32_t group) {
    Eigen::Vector2f middle = Eigen::Vector2f::Zero();
    float count = 0;
    const Hit* hit = nullptr;
    for (const Hit& h : hits) {
      if (h.group != group) continue;
      middle += h.at;
      ++count;
      if (hit == nullptr) hit = &h;
    }
    middle *= 0.6F / count;
    return shade(*hit, r, middle.x(), middle.y());
  };
  out.group_luminance = own(out.group);
  out.other_luminance = own(out.other);
  const float above = border_of(prepared_, *view_, out).fraction_above(r);
  const float fraction = out.group_above ? above : 1 - above;
  out.luminance = fraction * out.group_luminance + (1 - fraction) * out.other_luminance;
}

void TileSampler::sample(const SceneView& view, const TilePlan& plan, TileSamples& out) {
  view_ = &view;
  plan_ = &plan;
  patch_views_.clear();
  last_view_ = 0;
  const bool rays_needed =
      std::any_of(plan.pixel.begin(), plan.pixel.end(), [](PixelClass c) { return c != PixelClass::flat; });
  if (rays_needed) {
    trace_centres();
    trace_corners();
  }
  for (int y = 0; y < plan.tile.height; ++y) {
    for (int x = 0; x < plan.tile.width; ++x) {
      const std::size_t i = static_cast<std::size_t>(y) * kTilePx + x;
      PixelSample& sample = out[i];
      sample = {};
      if (plan.pixel[i] != PixelClass::flat) {
        sample_mixed(x, y, sample);  // a smooth pixel is a mixed one without a border
      } else if (plan.patch[i] < 0) {
        sample.luminance = static_cast<float>(prepared_.scene.sky_cd_m2);
      } else {
        const PatchView& patch = patch_view(-1, plan.patch[i]);
        sample.group = patch.patch->group;
        sample.object = static_cast<std::uint16_t>(patch.patch->object);
        sample.luminance = luminance(prepared_, view, patch, ray(plan.tile.x0 + x, plan.tile.y0 + y));
      }
    }
  }
}

}  // namespace evpose::sim
