// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/tile_sampler.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace evpose::sim {
namespace {

constexpr std::uint8_t kPlanes = 3;  // PixelSample::edge
constexpr int kScanLines = 4;
constexpr int kBisections = 5;  // of half a pixel: to 1/128

}  // namespace

Border border_of(const Stage& stage, const View& view, const PixelSample& sample) {
  if (sample.edge == kPlanes) {
    const PatchView a = view_patch(view, stage.still.patches[sample.a], -1),
                    b = view_patch(view, stage.still.patches[sample.b], -1);
    // The plane through the camera and the line where the two planes meet.
    const Eigen::Vector3d through = static_cast<double>(b.reach) * a.normal.cast<double>() -
                                    static_cast<double>(a.reach) * b.normal.cast<double>();
    return {through};
  }
  const Mesh& mesh = stage.mesh_of(sample.edge_part);
  const Mesh::Corners& corners = mesh.triangles[sample.a];
  const Pose& T_part_cam = sample.edge_part < 0 ? view.T_map_cam : view.T_part_cam[sample.edge_part];
  const Eigen::Vector3d p = mesh.vertices[corners[sample.edge]].cast<double>() - T_part_cam.p;
  const Eigen::Vector3d q = mesh.vertices[corners[(sample.edge + 1) % 3]].cast<double>() - T_part_cam.p;
  return {T_part_cam.q.conjugate() * p.cross(q)};
}

TileSampler::Hit TileSampler::trace(const PixelRay& ray, float x, float y) const {
  const Eigen::Vector3d in_camera = ray.direction(x, y).cast<double>();
  auto found = stage_.rays.trace(view_->T_map_cam.p, view_->R_map_cam * in_camera);
  for (const int part : movers_) {
    const Pose& T_part_cam = view_->T_part_cam[part];
    const auto closer =
        stage_.rays.trace_part(part, T_part_cam.p, T_part_cam.q * in_camera, 0,
                               found ? found->distance : std::numeric_limits<float>::infinity());
    if (closer) found = closer;
  }
  Hit hit;
  hit.at = {x, y};
  if (!found) return hit;
  const PartSurfaces& surfaces = stage_.surfaces_of(found->part);
  hit.patch = surfaces.patch_of[found->triangle];
  hit.group = surfaces.patches[hit.patch].group;
  hit.part = found->part;
  hit.triangle = found->triangle;
  hit.depth = found->distance;
  return hit;
}

const TileSampler::Hit& TileSampler::corner(int x, int y) {
  const std::size_t i = static_cast<std::size_t>(y) * kCorners + x;
  if (!traced_[i]) {
    // Of the pixel to the lower right, or the last there is.
    const int px = std::min(x, plan_->tile.width - 1), py = std::min(y, plan_->tile.height - 1);
    corners_[i] = trace(ray(plan_->tile.x0 + px, plan_->tile.y0 + py), static_cast<float>(x - px) - 0.5F,
                        static_cast<float>(y - py) - 0.5F);
    traced_[i] = true;
  }
  return corners_[i];
}

const PatchView& TileSampler::patch_view(int part, std::int32_t patch) {
  const Patch* wanted = &stage_.surfaces_of(part).patches[patch];
  if (last_view_ < patch_views_.size() && patch_views_[last_view_].patch == wanted)
    return patch_views_[last_view_];
  for (last_view_ = 0; last_view_ < patch_views_.size(); ++last_view_) {
    if (patch_views_[last_view_].patch == wanted) return patch_views_[last_view_];
  }
  patch_views_.push_back(view_patch(*view_, *wanted, part));
  return patch_views_.back();
}

float TileSampler::shade(const Hit& hit, const PixelRay& ray, float x, float y) {
  if (hit.group == kSky) return static_cast<float>(stage_.scene.sky_cd_m2);
  return luminance(stage_, *view_, patch_view(hit.part, hit.patch), ray, x, y);
}

void TileSampler::describe_hit(const Hit& hit, PixelSample& out) const {
  out.group = hit.group;
  out.part = static_cast<std::int8_t>(hit.part);
  if (hit.group != kSky)
    out.object = static_cast<std::uint16_t>(stage_.surfaces_of(hit.part).patches[hit.patch].object);
}

// True if the border has each of the two groups on one side of it.
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

// Finds the line that parts two groups: an edge of a triangle that was hit, the nearer surface's first, or
// the meeting of two planes.
bool TileSampler::split(const PixelRay& ray, const std::array<Hit, 5>& hits, PixelSample& out) {
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
    const PartSurfaces& surfaces = stage_.surfaces_of(hit.part);
    for (std::uint8_t edge = 0; edge < 3; ++edge) {
      if (!(surfaces.edges[hit.triangle] >> edge & 1)) continue;
      out.edge = edge;
      out.edge_part = static_cast<std::int8_t>(hit.part);
      out.a = hit.triangle;
      if (separates(border_of(stage_, *view_, out), ray, hits, out)) return true;
    }
  }
  const Hit& one = hits[0];
  const auto two = std::find_if(hits.begin(), hits.end(), [&](const Hit& h) { return h.group != one.group; });
  if (one.part >= 0 || two->part >= 0 || one.group == kSky || two->group == kSky) return false;
  out.edge = kPlanes;
  out.a = static_cast<std::uint32_t>(one.patch);
  out.b = static_cast<std::uint32_t>(two->patch);
  return separates(border_of(stage_, *view_, out), ray, hits, out);
}

// Looks for the borders along scan lines.
float TileSampler::scan(const PixelRay& ray, const std::array<Hit, 5>& hits) {
  // Hits are the centre and the corners, row by row. Scan across the borders.
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

// True if there is a step of depth or direction between two hits. What is stuck to a wall is print.
bool TileSampler::parted(const Hit& a, const Hit& b, const PixelRay& ray) const {
  constexpr double kSameNormal = 0.9998, kPrint_m = 2e-3;
  if (a.group == b.group) return false;
  if (a.group == kSky || b.group == kSky || a.part != b.part) return true;
  const Patch &p = stage_.surfaces_of(a.part).patches[a.patch],
              &q = stage_.surfaces_of(b.part).patches[b.patch];
  if (p.surface == q.surface) return false;
  if (p.normal.dot(q.normal) < kSameNormal) return true;
  // Distance of b's point from a's plane.
  const Pose& T_part_cam = a.part < 0 ? view_->T_map_cam : view_->T_part_cam[a.part];
  const Eigen::Vector3d point = T_part_cam * (b.depth * ray.direction(b.at.x(), b.at.y())).cast<double>();
  return std::abs(p.normal.dot(point) + p.offset) > kPrint_m;
}

void TileSampler::sample_open(int x, int y, PixelSample& out) {
  const PixelRay& r = ray(plan_->tile.x0 + x, plan_->tile.y0 + y);
  movers_.clear();
  for (const TilePlan::Mover& m : plan_->movers) {
    const int column = plan_->tile.x0 + x, row = plan_->tile.y0 + y;
    if (column >= m.x0 && column < m.x1 && row >= m.y0 && row < m.y1) movers_.push_back(m.part);
  }
  std::array<Hit, 5> hits{trace(r, 0, 0), corner(x, y), corner(x + 1, y), corner(x, y + 1),
                          corner(x + 1, y + 1)};
  constexpr std::array<float, 5> kX = {0, -0.5F, 0.5F, -0.5F, 0.5F}, kY = {0, -0.5F, -0.5F, 0.5F, 0.5F};
  std::int32_t other = kNone;
  for (int i = 0; i < 5; ++i) {
    hits[i].at = {kX[i], kY[i]};
    out.moving = out.moving || hits[i].part >= 0;
    if (hits[i].group == hits[0].group || hits[i].group == other) continue;
    other = other == kNone ? hits[i].group : kMany;
  }
  describe_hit(hits[0], out);
  if (other == kNone) {
    out.luminance = shade(hits[0], r, 0, 0);
    return;
  }
  for (const Hit& hit : hits) out.outline = out.outline || parted(hits[0], hit, r);
  out.other = other;
  if (other == kMany || !split(r, hits, out)) {
    out.other = kMany;
    out.luminance = scan(r, hits);
    return;
  }
  // Each group's own luminance, about the middle of its samples.
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
  out.of_group = own(out.group);
  out.of_other = own(out.other);
  const float above = border_of(stage_, *view_, out).share_above(r);
  const float share = out.group_above ? above : 1 - above;
  out.luminance = share * out.of_group + (1 - share) * out.of_other;
}

void TileSampler::sample(const View& view, const TilePlan& plan, TileSamples& out) {
  view_ = &view;
  plan_ = &plan;
  patch_views_.clear();
  last_view_ = 0;
  traced_.fill(false);
  for (int y = 0; y < plan.tile.height; ++y) {
    for (int x = 0; x < plan.tile.width; ++x) {
      const std::size_t i = static_cast<std::size_t>(y) * kTilePx + x;
      PixelSample& sample = out[i];
      sample = {};
      if (plan.pixel[i] == PixelClass::open) {
        sample_open(x, y, sample);
        continue;
      }
      const PixelRay& r = ray(plan.tile.x0 + x, plan.tile.y0 + y);
      if (plan.pixel[i] == PixelClass::smooth) {
        movers_.clear();
        const Hit hit = trace(r, 0, 0);
        describe_hit(hit, sample);
        sample.luminance = shade(hit, r, 0, 0);
        continue;
      }
      if (plan.patch[i] < 0) {
        sample.luminance = static_cast<float>(stage_.scene.sky_cd_m2);
        continue;
      }
      const PatchView& patch = patch_view(-1, plan.patch[i]);
      sample.group = patch.patch->group;
      sample.object = static_cast<std::uint16_t>(patch.patch->object);
      sample.luminance = luminance(stage_, view, patch, r);
    }
  }
}

}  // namespace evpose::sim
