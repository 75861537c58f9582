// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/light/lighting.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <span>

#include "evpose/core/parallel.h"
#include "evpose/sim/light/light_refinement.h"

namespace evpose::sim {
namespace {

constexpr int kShadowRays = 12;  // brightness steps of a penumbra, too fine to look like edges
constexpr int kAmbientRays = 24;
constexpr double kOcclusionReach_m = 1.5;  // occluders farther away do not darken ambient light
constexpr double kTexels = 5e5;            // of a world, about
constexpr double kFinest_m = 0.02, kCoarsest_m = 0.3;
constexpr double kFine_m = 0.03;       // at the feet of things and the rims of shadows
constexpr int kMostTexels = 2048;      // along a side
constexpr float kRayOffset_m = 2e-3F;  // distance from the surface at which shadow rays start
constexpr double kInset_m = 4e-3;      // distance from the rim of the surface at which they start

// Evenly spread points of the unit disc (sunflower seeds).
std::array<Eigen::Vector2d, kAmbientRays> sunflower_disc(int n) {
  std::array<Eigen::Vector2d, kAmbientRays> points;
  const double golden_angle = std::numbers::pi * (3 - std::sqrt(5.0));
  for (int i = 0; i < n; ++i)
    points[i] =
        std::sqrt((i + 0.5) / n) * Eigen::Vector2d(std::cos(i * golden_angle), std::sin(i * golden_angle));
  return points;
}

struct TangentBasis {
  Eigen::Vector3d a, b;
};
TangentBasis tangent_basis(const Eigen::Vector3d& n) {
  const Eigen::Vector3d other = std::abs(n.z()) < 0.9 ? Eigen::Vector3d::UnitZ() : Eigen::Vector3d::UnitX();
  const Eigen::Vector3d a = n.cross(other).normalized();
  return {a, n.cross(a)};
}

class LightBaker {
 public:
  LightBaker(const RayCaster& rays, const LightChannels& channels) : rays_(rays), channels_(channels) {}

  const Mesh& mesh() const { return rays_.scene().mesh; }
  std::size_t channels() const { return channels_.switching.size(); }

  void illuminance_at(const Eigen::Vector3d& point, const Eigen::Vector3d& normal, float* by_channel) const {
    const Scene& scene = rays_.scene();
    std::fill_n(by_channel, channels_.switching.size(), 0.0F);
    double ambient = -1;
    for (std::size_t i = 0; i < scene.lights.size(); ++i) {
      const Light& light = scene.lights[i];
      double lux = 0;
      switch (light.kind) {
        case LightKind::sun: {
          const double facing = -normal.dot(light.direction);
          if (facing > 0) lux = light.strength * facing * sun_visibility(point, light);
          break;
        }
        case LightKind::lamp: {
          const Eigen::Vector3d direction = light.position - point;
          const double facing = normal.dot(direction) / direction.norm();
          if (facing > 0)
            lux = light.strength * facing / direction.squaredNorm() * lamp_visibility(point, light);
          break;
        }
        case LightKind::ambient:
          if (ambient < 0) ambient = ambient_visibility(point, normal);
          lux = light.strength * ambient;
          break;
      }
      by_channel[channels_.of_light[i]] += static_cast<float>(lux);
    }
  }

 private:
  double sun_visibility(const Eigen::Vector3d& point, const Light& light) const {
    const TangentBasis basis = tangent_basis(light.direction);
    std::array<RayCaster::Segment, kShadowRays> segments;
    for (int i = 0; i < kShadowRays; ++i) {
      const Eigen::Vector2d at = light.radius * disc_[i];
      const Eigen::Vector3d direction = -light.direction + at.x() * basis.a + at.y() * basis.b;
      segments[i] = {direction.cast<float>(), kRayOffset_m, std::numeric_limits<float>::infinity()};
    }
    return visible(point, segments);
  }

  double lamp_visibility(const Eigen::Vector3d& point, const Light& light) const {
    const TangentBasis basis = tangent_basis((light.position - point).normalized());
    std::array<RayCaster::Segment, kShadowRays> segments;
    for (int i = 0; i < kShadowRays; ++i) {
      const Eigen::Vector2d at = light.radius * disc_[i];
      const Eigen::Vector3d direction = light.position + at.x() * basis.a + at.y() * basis.b - point;
      const auto length = static_cast<float>(direction.norm());
      // The housing of the lamp casts no shadow.
      const float end = 1 - std::min(0.5F, (static_cast<float>(light.radius) + 0.02F) / length);
      segments[i] = {direction.cast<float>(), kRayOffset_m / length, end};
    }
    return visible(point, segments);
  }

  double ambient_visibility(const Eigen::Vector3d& point, const Eigen::Vector3d& normal) const {
    const TangentBasis basis = tangent_basis(normal);
    std::array<RayCaster::Segment, kAmbientRays> segments;
    for (int i = 0; i < kAmbientRays; ++i) {
      const Eigen::Vector2d& at = sky_[i];
      const Eigen::Vector3d direction =
          at.x() * basis.a + at.y() * basis.b + std::sqrt(std::max(0.0, 1 - at.squaredNorm())) * normal;
      segments[i] = {direction.cast<float>(), kRayOffset_m, static_cast<float>(kOcclusionReach_m)};
    }
    return visible(point, segments);
  }

  // Fraction of the segments that nothing blocks.
  double visible(const Eigen::Vector3d& point, std::span<const RayCaster::Segment> segments) const {
    int free = 0;
    for (std::size_t i = 0; i < segments.size(); i += RayCaster::kMostSegments)
      free += std::popcount(rays_.free_segments(
          point, segments.subspan(i, std::min(RayCaster::kMostSegments, segments.size() - i))));
    return static_cast<double>(free) / static_cast<double>(segments.size());
  }

  const RayCaster& rays_;
  const LightChannels& channels_;
  std::array<Eigen::Vector2d, kAmbientRays> disc_ = sunflower_disc(kShadowRays),
                                            sky_ = sunflower_disc(kAmbientRays);
};

struct FlatTriangle {
  std::array<Eigen::Vector2d, 3> corner;
  std::array<Eigen::Vector3d, 3> normal;
  Eigen::AlignedBox2d box;  ///< of the corners
};

double cross2(const Eigen::Vector2d& a, const Eigen::Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

// Barycentric weights of the point of the triangle that is nearest to `p`. Negative weights are clipped,
// which is exact enough for light.
Eigen::Vector3d weights(const FlatTriangle& t, const Eigen::Vector2d& p) {
  const Eigen::Vector2d ab = t.corner[1] - t.corner[0], ac = t.corner[2] - t.corner[0], ap = p - t.corner[0];
  const double area = cross2(ab, ac);
  if (std::abs(area) < 1e-12) return {1, 0, 0};
  Eigen::Vector3d w(0, cross2(ap, ac) / area, cross2(ab, ap) / area);
  w[0] = 1 - w[1] - w[2];
  w = w.cwiseMax(0.0);
  return w / w.sum();
}

// The point of a patch that is nearest to the centre of a texel.
struct PatchPoint {
  Eigen::Vector2d at;
  Eigen::Vector3d normal;
};
PatchPoint nearest_point(const std::vector<FlatTriangle>& triangles, const Eigen::Vector2d& p) {
  constexpr double kInside_m2 = 1e-12;
  constexpr double kRounding = 1 + 1e-9;
  PatchPoint best{};
  double least = std::numeric_limits<double>::infinity();
  const auto try_triangle = [&](const FlatTriangle& t) {
    const Eigen::Vector3d w = weights(t, p);
    const Eigen::Vector2d at = w[0] * t.corner[0] + w[1] * t.corner[1] + w[2] * t.corner[2];
    const double distance = (at - p).squaredNorm();
    if (distance >= least) return;
    least = distance;
    const Eigen::Vector2d middle = (t.corner[0] + t.corner[1] + t.corner[2]) / 3;
    const Eigen::Vector2d inward = middle - at;
    const double length = inward.norm();
    best.at = length > 0 ? Eigen::Vector2d(at + std::min(kInset_m, 0.5 * length) / length * inward) : at;
    best.normal = (w[0] * t.normal[0] + w[1] * t.normal[1] + w[2] * t.normal[2]).normalized();
  };
  // The triangle around the point, if there is one: none before it in the list is as near.
  for (const FlatTriangle& t : triangles) {
    if (t.box.squaredExteriorDistance(p) > kInside_m2) continue;
    least = std::numeric_limits<double>::infinity();
    try_triangle(t);
    if (least < kInside_m2) return best;
  }
  least = std::numeric_limits<double>::infinity();
  for (const FlatTriangle& t : triangles)
    if (t.box.squaredExteriorDistance(p) <= kRounding * least) try_triangle(t);
  return best;
}

double area_of(const Mesh& mesh) {
  double area = 0;
  for (const Mesh::Corners& c : mesh.triangles) {
    const Eigen::Vector3f ab = mesh.vertices[c[1]] - mesh.vertices[c[0]],
                          ac = mesh.vertices[c[2]] - mesh.vertices[c[0]];
    area += 0.5 * static_cast<double>(ab.cross(ac).norm());
  }
  return area;
}

std::vector<FlatTriangle> flatten(const Mesh& mesh, const std::vector<std::size_t>& triangles,
                                  const LightMap& map) {
  std::vector<FlatTriangle> flat;
  for (const std::size_t i : triangles) {
    FlatTriangle t;
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3d p = mesh.vertices[mesh.triangles[i][k]].cast<double>();
      t.corner[k] = {map.right.dot(p), map.up.dot(p)};
      t.normal[k] = mesh.normals[i][k].cast<double>();
      t.box.extend(t.corner[k]);
    }
    flat.push_back(t);
  }
  return flat;
}

void set_grid(const std::vector<FlatTriangle>& flat, double texel_m, LightMap& map) {
  Eigen::Vector2d low = flat[0].corner[0], high = low;
  for (const FlatTriangle& t : flat) {
    for (const Eigen::Vector2d& c : t.corner) {
      low = low.cwiseMin(c);
      high = high.cwiseMax(c);
    }
  }
  const Eigen::Vector2d size = high - low;
  const double texel = std::max(texel_m, size.maxCoeff() / (kMostTexels - 1));
  map.per_metre = 1 / texel;
  map.columns = 1 + static_cast<int>(std::ceil(size.x() / texel));
  map.rows = 1 + static_cast<int>(std::ceil(size.y() / texel));
  map.right0 = low.x();
  map.up0 = low.y();
}

// Computes one texel of the light map of a patch.
void bake_texel(const LightBaker& baker, const std::vector<FlatTriangle>& flat, Patch& patch, std::size_t i) {
  LightMap& map = patch.light;
  const std::size_t column = i % map.columns, row = i / map.columns;
  const PatchPoint nearest = nearest_point(flat, {map.right0 + static_cast<double>(column) / map.per_metre,
                                                  map.up0 + static_cast<double>(row) / map.per_metre});
  const Eigen::Vector3d point =
      nearest.at.x() * map.right + nearest.at.y() * map.up - patch.offset * patch.normal;
  std::vector<float> light(baker.channels());
  baker.illuminance_at(point, nearest.normal, light.data());
  const std::size_t texels = static_cast<std::size_t>(map.columns) * map.rows;
  for (std::size_t c = 0; c < light.size(); ++c) map.values[c * texels + i] = light[c];
}

// The corners of all things, each place once, sorted along x.
std::vector<Eigen::Vector3d> corners_along_x(const Mesh& mesh) {
  std::vector<Eigen::Vector3f> places = mesh.vertices;
  std::sort(places.begin(), places.end(), [](const Eigen::Vector3f& a, const Eigen::Vector3f& b) {
    return std::lexicographical_compare(a.begin(), a.end(), b.begin(), b.end());
  });
  places.erase(std::unique(places.begin(), places.end()), places.end());
  std::vector<Eigen::Vector3d> out;
  out.reserve(places.size());
  for (const Eigen::Vector3f& p : places) out.emplace_back(p.cast<double>());
  return out;
}

// The cells that corners of things touch.
void want_feet(const std::vector<Eigen::Vector3d>& corners, const Patch& patch, LightRefinement& finer) {
  const LightMap& map = patch.light;
  // The range of x of the map's rectangle and of what is near it.
  double low = -patch.offset * patch.normal.x() - kFine_m, high = low + 2 * kFine_m;
  const auto add_side = [&](double axis_x, double start, int texels) {
    const double a = axis_x * start, b = axis_x * (start + (texels - 1) / map.per_metre);
    low += std::min(a, b);
    high += std::max(a, b);
  };
  add_side(map.right.x(), map.right0, map.columns);
  add_side(map.up.x(), map.up0, map.rows);
  const auto first = std::lower_bound(corners.begin(), corners.end(), low,
                                      [](const Eigen::Vector3d& p, double x) { return p.x() < x; });
  for (auto at = first; at != corners.end() && at->x() <= high; ++at)
    if (std::abs(patch.normal.dot(*at) + patch.offset) < kFine_m)
      finer.want_cell_at({map.right.dot(*at), map.up.dot(*at)});
}

void refine(const LightBaker& baker, const std::vector<std::vector<FlatTriangle>>& flat,
            PartSurfaces& surfaces, ThreadPool& pool) {
  const std::vector<Eigen::Vector3d> corners = corners_along_x(baker.mesh());
  std::vector<std::optional<LightRefinement>> finer(surfaces.patches.size());
  pool.for_chunks(finer.size(), 1, [&](std::size_t, std::size_t k, std::size_t) {
    want_feet(corners, surfaces.patches[k], finer[k].emplace(surfaces.patches[k].light, kFine_m));
  });
  struct Job {
    std::size_t patch, texel;
  };
  std::vector<Job> jobs;
  std::vector<std::vector<std::uint32_t>> texels(finer.size());
  do {
    pool.for_chunks(finer.size(), 1,
                    [&](std::size_t, std::size_t k, std::size_t) { texels[k] = finer[k]->next_texels(); });
    jobs.clear();
    for (std::size_t k = 0; k < finer.size(); ++k)
      for (const std::uint32_t texel : texels[k]) jobs.push_back({k, texel});
    pool.for_chunks(jobs.size(), 256, [&](std::size_t, std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i)
        bake_texel(baker, flat[jobs[i].patch], surfaces.patches[jobs[i].patch], jobs[i].texel);
    });
  } while (!jobs.empty());
}

}  // namespace

std::vector<float> LightChannels::factors(double t_s) const {
  std::vector<float> out;
  for (const LightSwitching& s : switching) out.push_back(static_cast<float>(s.factor(t_s)));
  return out;
}

double LightChannels::step_s(double t_s) const {
  double step = std::numeric_limits<double>::infinity();
  for (const LightSwitching& s : switching) step = std::min(step, s.step_s(t_s));
  return step;
}

double LightChannels::next_switch_s(double t_s) const {
  double next = std::numeric_limits<double>::infinity();
  for (const LightSwitching& s : switching) next = std::min(next, s.next_switch_s(t_s));
  return next;
}

LightChannels light_channels(const Scene& scene) {
  LightChannels channels;
  channels.switching.emplace_back();
  for (const Light& light : scene.lights) {
    const LightSwitching switching = light.switching.constant() ? LightSwitching{} : light.switching;
    auto at = std::find(channels.switching.begin(), channels.switching.end(), switching);
    if (at == channels.switching.end()) at = channels.switching.insert(at, switching);
    channels.of_light.push_back(static_cast<int>(at - channels.switching.begin()));
  }
  return channels;
}

void bake_lights(const RayCaster& rays, const LightChannels& channels, PartSurfaces& surfaces,
                 ThreadPool& pool) {
  const Mesh& mesh = rays.scene().mesh;
  const LightBaker baker(rays, channels);
  const double texel_m = std::clamp(std::sqrt(area_of(mesh) / kTexels), kFinest_m, kCoarsest_m);
  std::vector<std::vector<std::size_t>> triangles(surfaces.patches.size());
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) triangles[surfaces.patch_of[i]].push_back(i);
  std::vector<std::vector<FlatTriangle>> flat(surfaces.patches.size());
  pool.for_chunks(surfaces.patches.size(), 1, [&](std::size_t, std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      LightMap& map = surfaces.patches[k].light;
      const TangentBasis basis = tangent_basis(surfaces.patches[k].normal);
      map.right = basis.a;
      map.up = basis.b;
      flat[k] = flatten(mesh, triangles[k], map);
      set_grid(flat[k], texel_m, map);
      const std::size_t texels = static_cast<std::size_t>(map.columns) * map.rows;
      map.values.resize(texels * channels.switching.size());
      for (std::size_t i = 0; i < texels; ++i) bake_texel(baker, flat[k], surfaces.patches[k], i);
    }
  });
  if (texel_m > kFine_m) refine(baker, flat, surfaces, pool);
}

void unoccluded_light(const Scene& scene, const LightChannels& channels, const Eigen::Vector3d& point,
                      const Eigen::Vector3d& normal, float* by_channel) {
  std::fill_n(by_channel, channels.switching.size(), 0.0F);
  for (std::size_t i = 0; i < scene.lights.size(); ++i) {
    const Light& light = scene.lights[i];
    double lux = light.strength;
    if (light.kind == LightKind::sun) lux *= std::max(0.0, -normal.dot(light.direction));
    if (light.kind == LightKind::lamp) {
      const Eigen::Vector3d direction = light.position - point;
      lux *= std::max(0.0, normal.dot(direction)) / (direction.norm() * direction.squaredNorm());
    }
    by_channel[channels.of_light[i]] += static_cast<float>(lux);
  }
}

}  // namespace evpose::sim
