// SPDX-License-Identifier: BSD-3-Clause
// Pixels in which several surfaces meet.
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "evpose/sim/light/tile_sampler.h"

namespace evpose::sim {
namespace {

constexpr std::uint8_t kPlanes = 3;  // BorderSample::edge
constexpr int kScanLines = 4;
constexpr int kBisections = 5;  // of half a pixel: to 1/128

}  // namespace

Border border_of(const PreparedScene& prepared, const SceneView& view, const BorderSample& sample) {
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

// True if each of the two groups is on one side of the border.
bool TileSampler::separates(const Border& border, const PixelRay& ray, const Hits& hits, std::int32_t group,
                            BorderSample& out) const {
  const float level = border.level(ray);
  const Eigen::Vector2f slope = border.slope(ray);
  bool above = false, first = true;
  for (const Hit& hit : hits) {
    const float value = level + slope.dot(hit.at);
    const bool side = (value > 0) == (hit.group == group);
    if (first) above = side;
    if (side != above) return false;
    first = false;
  }
  out.group_above = above;
  return true;
}

// Finds the line that separates two groups: an edge of a triangle that was hit, nearest triangle first, or
// the intersection of two planes.
bool TileSampler::fit_border(const PixelRay& ray, const Hits& hits, std::int32_t group,
                             BorderSample& out) const {
  std::array<const Hit*, 5> by_depth{};
  for (int i = 0; i < 5; ++i) by_depth[i] = &hits[i];
  std::stable_sort(by_depth.begin(), by_depth.end(),
                   [](const Hit* a, const Hit* b) { return a->nearness > b->nearness; });
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
      const Border border =
          hit.part < 0 ? Border{raster_.shapes()[hit.shape].edges[edge]} : border_of(prepared_, *view_, out);
      if (separates(border, ray, hits, group, out)) return true;
    }
  }
  const Hit& one = hits[0];
  const auto two = std::find_if(hits.begin(), hits.end(), [&](const Hit& h) { return h.group != one.group; });
  if (one.part >= 0 || two->part >= 0 || one.group == kSky || two->group == kSky) return false;
  out.edge = kPlanes;
  out.edge_part = -1;
  out.a = static_cast<std::uint32_t>(one.patch);
  out.b = static_cast<std::uint32_t>(two->patch);
  return separates(border_of(prepared_, *view_, out), ray, hits, group, out);
}

std::array<TileSampler::Hit, kLanes> TileSampler::hits_along(const PixelRay& ray,
                                                             const std::array<Eigen::Vector2f, kLanes>& at) {
  FloatLanes x, y;
  std::array<Eigen::Vector3f, kLanes> directions;
  for (int i = 0; i < kLanes; ++i) {
    directions[i] = ray.direction(at[i].x(), at[i].y());
    x[i] = directions[i].x();
    y[i] = directions[i].y();
  }
  const IntLanes shape = raster_.find(x, y).shape;
  std::array<Hit, kLanes> hits;
  std::array<Hit*, kLanes> wanted;
  for (int i = 0; i < kLanes; ++i) {
    hits[i] = hit_of(shape[i], x[i], y[i]);
    wanted[i] = &hits[i];
  }
  for (const int part : movers_) add_mover(part, directions, wanted);
  for (int i = 0; i < kLanes; ++i) hits[i].at = at[i];
  return hits;
}

TileSampler::Hits TileSampler::wide_hits_of(std::size_t pixel) {
  std::array<Eigen::Vector2f, kLanes> at;
  for (int i = 0; i < kLanes; ++i) {
    const float far = i < 4 ? 0.5F : 0.25F;
    at[i] = {i % 2 == 0 ? -far : far, i % 4 < 2 ? -far : far};
  }
  const auto found = hits_along(ray(pixel), at);
  Hits hits;
  hits[0] = hit_at(pixel);
  std::copy_n(found.begin(), 4, hits.begin() + 1);
  between_.assign(found.begin() + 4, found.end());
  return hits;
}

// Asks for the luminance along scan lines, which run across the borders. The lines of a widened pixel have
// two parts each.
void TileSampler::want_scan_lines(std::size_t pixel, const Hits& hits) {
  const bool across_columns = hits[1].group != hits[2].group || hits[3].group != hits[4].group ||
                              (hits[1].group == hits[3].group && hits[2].group == hits[4].group);
  if (is_wide()) {
    scan(pixel, across_columns, -0.5F, 0);
    scan(pixel, across_columns, 0, 0.5F);
  } else {
    scan(pixel, across_columns, -0.5F, 0.5F);
  }
}

// Finds the borders on a part of each scan line by bisection. Lanes 0 to 3 are the first halves of the parts,
// 4 to 7 the second.
void TileSampler::scan(std::size_t pixel, bool across_columns, float begin, float end) {
  const PixelRay& r = ray(pixel);
  const float half = 0.5F * (begin + end);
  const auto place = [&](int line, float along) {
    const float fixed = (static_cast<float>(line) + 0.5F) / kScanLines - 0.5F;
    return across_columns ? Eigen::Vector2f(along, fixed) : Eigen::Vector2f(fixed, along);
  };
  static_assert(2 * kScanLines == kLanes);
  std::array<Eigen::Vector2f, kLanes> at;
  const auto hits_at = [&](const auto& along) {
    for (int i = 0; i < kLanes; ++i) at[i] = place(i % kScanLines, along(i));
    return hits_along(r, at);
  };
  std::array<float, kLanes> low, high;
  for (int i = 0; i < kLanes; ++i)
    low[i] = i < kScanLines ? begin : half, high[i] = i < kScanLines ? half : end;
  const auto starts = hits_at([&](int i) { return low[i]; });
  const auto ends = hits_at([&](int i) { return high[i]; });
  for (int k = 0; k < kBisections; ++k) {
    const auto middle = hits_at([&](int i) { return 0.5F * (low[i] + high[i]); });
    for (int i = 0; i < kLanes; ++i)
      (middle[i].group == starts[i].group ? low : high)[i] = 0.5F * (low[i] + high[i]);
  }
  const auto add = [&](int line, const Hit& hit, float from, float to) {
    const Eigen::Vector3f direction =
        r.direction(place(line, 0.5F * (from + to)).x(), place(line, 0.5F * (from + to)).y());
    pending_.push_back({pixel, (to - from) / kScanLines, want(hit, pixel, direction.x(), direction.y())});
  };
  for (int line = 0; line < kScanLines; ++line) {
    const Hit* left = &starts[line];
    float from = begin;
    for (const int i : {line, line + kScanLines}) {
      if (ends[i].group == left->group) continue;
      const float border = 0.5F * (low[i] + high[i]);
      add(line, *left, from, border);
      from = border;
      left = &ends[i];
    }
    add(line, *left, from, end);
  }
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
  const Eigen::Vector3d point = T_part_cam * (ray.direction(b.at.x(), b.at.y()) / b.nearness).cast<double>();
  return std::abs(p.normal.dot(point) + p.offset) > kPrint_m;
}

// Asks for the luminance of each of two groups, near the mean of its hits.
void TileSampler::want_sides(std::size_t pixel, const Hits& hits, BorderSample& border) {
  const PixelRay& r = ray(pixel);
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
    const Eigen::Vector3f direction = r.direction(middle.x(), middle.y());
    return want(*hit, pixel, direction.x(), direction.y());
  };
  const float above = border_of(prepared_, *view_, border).fraction_above(r);
  const std::size_t group = own(hits[0].group), other = own(border.other);
  sides_.push_back({pixel, group, other, border.group_above ? above : 1 - above});
}

void TileSampler::sample_border(std::size_t pixel, TileSamples& out) {
  const PixelRay& r = ray(pixel);
  find_movers(pixel);
  between_.clear();
  const Hits hits = is_wide() ? wide_hits_of(pixel) : hits_of(pixel);
  BorderSample border;
  bool moving = false, outline = false;
  for (int i = 0; i < 5; ++i) {
    moving = moving || hits[i].part >= 0;
    if (hits[i].group == hits[0].group || hits[i].group == border.other) continue;
    border.other = border.other == kNone ? hits[i].group : kMany;
  }
  for (const Hit& hit : between_) {
    moving = moving || hit.part >= 0;
    outline = outline || is_geometric_edge(hits[0], hit, r);
    if (hit.group != hits[0].group && hit.group != border.other) border.other = kMany;
  }
  set_centre(hits[0], pixel, out);
  if (border.other == kNone) {
    if (hits[0].part < 0) out.patch[pixel] = hits[0].patch;
    pending_.push_back({pixel, 1, want(hits[0], pixel, raster_.x()[pixel], raster_.y()[pixel])});
  } else {
    for (const Hit& hit : hits) outline = outline || is_geometric_edge(hits[0], hit, r);
    if (border.other != kMany && fit_border(r, hits, hits[0].group, border)) {
      want_sides(pixel, hits, border);
    } else {
      border.other = kMany;
      want_scan_lines(pixel, hits);
    }
    out.border[pixel] = static_cast<std::int16_t>(out.borders.size());
    out.borders.push_back(border);
  }
  out.flags[pixel] =
      static_cast<std::uint8_t>((moving ? TileSamples::kMoving : 0) | (outline ? TileSamples::kOutline : 0));
}

}  // namespace evpose::sim
