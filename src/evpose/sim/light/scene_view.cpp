// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/light/scene_view.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <type_traits>
#include <utility>

#include "evpose/sim/world/texture.h"

namespace evpose::sim {
namespace {

constexpr std::size_t kMostChannels = 16;

// Illuminance of the light map, each channel weighted by its factor.
template <class V>
V baked_light(const LightMap& map, const std::vector<float>& factors, V right, V up) {
  using Int = typename LaneTypes<V>::Int;
  const auto per_metre = static_cast<float>(map.per_metre);
  const auto clamped = [](V v, int most) {
    v = select(v > 0.0F, v, all<V>(0));  // also where it is not a number
    return smaller(v, all<V>(static_cast<float>(most)));
  };
  const V x = clamped(right * per_metre, map.columns - 1), y = clamped(up * per_metre, map.rows - 1);
  const Int i = smaller(to_int(x), Int(Int{} + std::max(map.columns - 2, 0))),
            j = smaller(to_int(y), Int(Int{} + std::max(map.rows - 2, 0)));
  const int di = map.columns > 1 ? 1 : 0, dj = map.rows > 1 ? map.columns : 0;
  const V a = x - to_float(i), b = y - to_float(j);
  const std::size_t texels = static_cast<std::size_t>(map.columns) * map.rows;
  const Int at = j * map.columns + i;
  const float* values = map.values.data();
  V sum{};
  for (const float factor : factors) {
    const V low0 = gather(values, at), high0 = gather(values + dj, at);
    const V low = low0 + a * (gather(values + di, at) - low0);
    const V high = high0 + a * (gather(values + dj + di, at) - high0);
    sum = sum + factor * (low + b * (high - low));
    values += texels;
  }
  return sum;
}

float moving_light(const PreparedScene& prepared, const SceneView& view, const PatchView& patch,
                   const RayAreas<float>& ray, float depth) {
  const Eigen::Vector3f ray_cam(ray.x, ray.y, 1);
  std::array<float, kMostChannels> by_channel{};
  const Eigen::Vector3d point = view.T_map_cam * (depth * ray_cam).cast<double>();
  Eigen::Vector3d normal = view.T_map_part[patch.part].q * patch.patch->normal;
  // Both sides of a blade are lit.
  if (normal.dot(view.R_map_cam * ray_cam.cast<double>()) > 0) normal = -normal;
  unoccluded_light(prepared.scene, prepared.channels, point, normal, by_channel.data());
  float sum = 0;
  for (std::size_t i = 0; i < view.light.size(); ++i) sum += view.light[i] * by_channel[i];
  return sum;
}
FloatLanes moving_light(const PreparedScene& prepared, const SceneView& view, const PatchView& patch,
                        const RayAreas<FloatLanes>& r, FloatLanes depth) {
  FloatLanes out;
  for (int i = 0; i < kLanes; ++i)
    out[i] = moving_light(prepared, view, patch, RayAreas<float>{r.x[i], r.y[i], 0, 0, 0, 0}, depth[i]);
  return out;
}

}  // namespace

SceneView make_scene_view(const PreparedScene& prepared, double t_s, const Pose& T_map_cam) {
  EVPOSE_CHECK(prepared.channels.switching.size() <= kMostChannels);
  SceneView view{t_s, T_map_cam, T_map_cam.rotation(), prepared.channels.factors(t_s), {}, {}, {}};
  for (const MovingPart& part : prepared.scene.moving) {
    view.T_map_part.push_back(part.T_map_part(t_s));
    view.T_part_cam.push_back(view.T_map_part.back().inverse() * T_map_cam);
  }
  for (const Pane& pane : prepared.scene.panes)
    if (const auto seen = make_pane_view(pane, T_map_cam)) view.panes.push_back(*seen);
  return view;
}

SceneView interpolate_view(const SceneView& a, const SceneView& b, double fraction) {
  SceneView view;
  view.t_s = a.t_s + fraction * (b.t_s - a.t_s);
  view.T_map_cam = interpolate(a.T_map_cam, b.T_map_cam, fraction);
  view.R_map_cam = view.T_map_cam.rotation();
  for (std::size_t i = 0; i < a.light.size(); ++i)
    view.light.push_back(a.light[i] + static_cast<float>(fraction) * (b.light[i] - a.light[i]));
  for (std::size_t i = 0; i < a.T_map_part.size(); ++i) {
    view.T_map_part.push_back(interpolate(a.T_map_part[i], b.T_map_part[i], fraction));
    view.T_part_cam.push_back(view.T_map_part.back().inverse() * view.T_map_cam);
  }
  for (const PaneView& pane : a.panes)
    if (const auto seen = make_pane_view(*pane.pane, view.T_map_cam)) view.panes.push_back(*seen);
  return view;
}

PatchView make_patch_view(const SceneView& view, const Patch& patch, int part) {
  if (part < 0) return make_patch_view(view.T_map_cam.p, view.R_map_cam, patch, part);
  return make_patch_view(view.T_part_cam[part].p, view.T_part_cam[part].rotation(), patch, part);
}

PatchView make_patch_view(const Eigen::Vector3d& origin, const Eigen::Matrix3d& R_part_frame,
                          const Patch& patch, int part) {
  const Eigen::Matrix3d R = R_part_frame.transpose();
  PatchView out;
  out.patch = &patch;
  out.part = part;
  out.normal = (R * patch.normal).cast<float>();
  out.reach = static_cast<float>(-(patch.normal.dot(origin) + patch.offset));
  out.u_axis = (R * patch.u_axis).cast<float>();
  out.v_axis = (R * patch.v_axis).cast<float>();
  out.u = static_cast<float>(patch.u_axis.dot(origin) + patch.u0);
  out.v = static_cast<float>(patch.v_axis.dot(origin) + patch.v0);
  if (patch.light.columns > 0) {
    out.right = (R * patch.light.right).cast<float>();
    out.up = (R * patch.light.up).cast<float>();
    out.right0 = static_cast<float>(patch.light.right.dot(origin) - patch.light.right0);
    out.up0 = static_cast<float>(patch.light.up.dot(origin) - patch.light.up0);
  }
  return out;
}

namespace {

// Without the coat.
template <class V>
V matt_luminance(const PreparedScene& prepared, const SceneView& view, const PatchView& patch,
                 const RayAreas<V>& r) {
  const auto along = [&r](const Eigen::Vector3f& axis) { return sim::along(axis, r.x, r.y); };
  const V inverse = 1.0F / along(patch.normal), depth = patch.reach * inverse;
  const Material& material = prepared.scene.materials[patch.patch->material];
  V reflectance = all<V>(static_cast<float>(material.reflectance));
  if (material.texture) {
    const V along_u = along(patch.u_axis), along_v = along(patch.v_axis);
    const auto change = [&](const V& dx, const V& dy, const Eigen::Vector3f& axis, const V& value) {
      const V turn = (patch.normal.x() * dx + patch.normal.y() * dy) * inverse;
      return V(depth * (axis.x() * dx + axis.y() * dy - value * turn));
    };
    reflectance = reflectance * material.texture->mean(Texture::Footprint<V>{
                                    patch.u + depth * along_u, patch.v + depth * along_v,
                                    change(r.column_x, r.column_y, patch.u_axis, along_u),
                                    change(r.column_x, r.column_y, patch.v_axis, along_v),
                                    change(r.row_x, r.row_y, patch.u_axis, along_u),
                                    change(r.row_x, r.row_y, patch.v_axis, along_v)});
  }
  const LightMap& map = patch.patch->light;
  const V lux = map.columns > 0 ? baked_light(map, view.light, V(patch.right0 + depth * along(patch.right)),
                                              V(patch.up0 + depth * along(patch.up)))
                                : moving_light(prepared, view, patch, r, depth);
  auto emission = static_cast<float>(material.emission_cd_m2);
  if (emission > 0 && material.emission_light >= 0)
    emission *= view.light[prepared.channels.of_light[material.emission_light]];
  return reflectance * lux * std::numbers::inv_pi_v<float> + emission;
}

float lane(float v, int) { return v; }
float lane(const FloatLanes& v, int i) { return v[i]; }
void set_lane(float& v, int, float value) { v = value; }
void set_lane(FloatLanes& v, int i, float value) { v[i] = value; }
bool is_set(bool mask, int) { return mask; }
bool is_set(const IntLanes& mask, int i) { return mask[i] != 0; }
template <class V>
constexpr int lanes() {
  return std::is_same_v<V, float> ? 1 : kLanes;
}

// What a plane mirrors where it is wanted: the scene as seen from behind the mirror, along the same rays.
template <class V>
V mirrored_luminance(const PreparedScene& prepared, const SceneView& view, const MirrorPlane& mirror,
                     const RayAreas<V>& r, const typename LaneTypes<V>::Mask& wanted) {
  constexpr float kSkipped_m = 2e-3F;  // prints on the mirror do not mirror themselves
  const Eigen::Vector3d& n = mirror.normal;
  const Eigen::Vector3d origin = view.T_map_cam.p - 2 * (n.dot(view.T_map_cam.p) + mirror.offset) * n;
  const Eigen::Matrix3d R = view.R_map_cam - 2 * n * (n.transpose() * view.R_map_cam);
  V sum{};
  for (const auto& [a, b] : {std::pair{-0.25F, -0.25F}, {0.25F, -0.25F}, {-0.25F, 0.25F}, {0.25F, 0.25F}}) {
    const RayAreas<V> quarter{r.x + a * r.column_x + b * r.row_x,
                              r.y + a * r.column_y + b * r.row_y,
                              0.5F * r.column_x,
                              0.5F * r.column_y,
                              0.5F * r.row_x,
                              0.5F * r.row_y};
    std::array<const Patch*, kLanes> met{};
    for (int i = 0; i < lanes<V>(); ++i) {
      if (!is_set(wanted, i)) continue;
      const Eigen::Vector3f ray(lane(quarter.x, i), lane(quarter.y, i), 1);
      const float depth = std::max(0.0F, mirror.reach / mirror.in_camera.dot(ray));
      const auto hit = prepared.rays.trace(origin, R * ray.cast<double>(), depth + kSkipped_m);
      if (hit) met[i] = &prepared.patch_of(*hit);
    }
    V seen = all<V>(static_cast<float>(prepared.scene.sky_cd_m2));
    for (int i = 0; i < lanes<V>(); ++i) {
      const Patch* const patch = met[i];
      if (patch == nullptr) continue;
      const V own = matt_luminance(prepared, view, make_patch_view(origin, R, *patch, -1), quarter);
      for (int k = i; k < lanes<V>(); ++k) {
        if (met[k] != patch) continue;
        set_lane(seen, k, lane(own, k));
        met[k] = nullptr;
      }
    }
    sum = sum + seen;
  }
  return 0.25F * sum;
}

// Adds what a clear coat mirrors, by Schlick's law of the angle (1994).
template <class V>
V coated(const PreparedScene& prepared, const SceneView& view, const PatchView& patch, const RayAreas<V>& r,
         const V& matt) {
  const auto normal = static_cast<float>(prepared.scene.materials[patch.patch->material].mirror);
  V mirrored{};
  for (int i = 0; i < lanes<V>(); ++i) {
    const Eigen::Vector3f ray(lane(r.x, i), lane(r.y, i), 1);
    const float rest = 1 - std::min(1.0F, std::abs(patch.normal.dot(ray)) / ray.norm()), square = rest * rest;
    set_lane(mirrored, i, normal + (1 - normal) * square * square * rest);
  }
  const MirrorPlane mirror{patch.patch->normal, patch.patch->offset, patch.normal, patch.reach};
  const auto everywhere = V{} == V{};
  return (1 - mirrored) * matt + mirrored * mirrored_luminance(prepared, view, mirror, r, everywhere);
}

// `behind` as seen through the panes that are nearer than the nearness `beyond`, 1 / m, the farthest first.
template <class V>
V through_panes(const PreparedScene& prepared, const SceneView& view, const RayAreas<V>& r, V beyond,
                V behind) {
  using Int = typename LaneTypes<V>::Int;
  for (;;) {
    V nearness = all<V>(std::numeric_limits<float>::infinity());
    Int farthest = Int{} - 1;
    for (std::size_t k = 0; k < view.panes.size(); ++k) {
      const V own = along(view.panes[k].nearness, r.x, r.y);
      const auto farther = (own < nearness) & meets(view.panes[k], r.x, r.y, beyond);
      nearness = select(farther, own, nearness);
      farthest = select(farther, Int{} + static_cast<std::int32_t>(k), farthest);
    }
    if (!any(farthest >= 0)) return behind;
    for (std::size_t k = 0; k < view.panes.size(); ++k) {
      const typename LaneTypes<V>::Mask here = farthest == static_cast<std::int32_t>(k);
      if (!any(here)) continue;
      const MirrorPlane& mirror = view.panes[k].mirror;
      V mirrored{}, through{};
      for (int i = 0; i < lanes<V>(); ++i) {
        const Eigen::Vector3d ray(lane(r.x, i), lane(r.y, i), 1);
        const double cosine = std::abs(mirror.in_camera.cast<double>().dot(ray)) / ray.norm();
        const PlateLight plate = plate_light(std::min(1.0, cosine), kGlassIndex);
        set_lane(mirrored, i, static_cast<float>(plate.mirrored));
        set_lane(through, i, static_cast<float>(plate.through));
      }
      const V light = through * behind + mirrored * mirrored_luminance(prepared, view, mirror, r, here);
      behind = select(here, light, behind);
    }
    beyond = select(farthest >= 0, nearness, beyond);
  }
}

}  // namespace

template <class V>
V luminance(const PreparedScene& prepared, const SceneView& view, const PatchView& patch,
            const RayAreas<V>& areas) {
  V out = matt_luminance(prepared, view, patch, areas);
  if (prepared.scene.materials[patch.patch->material].mirror > 0 && patch.part < 0)
    out = coated(prepared, view, patch, areas, out);
  if (view.panes.empty()) return out;
  return through_panes(prepared, view, areas, V(along(patch.normal, areas.x, areas.y) / patch.reach), out);
}

template <class V>
V sky_luminance(const PreparedScene& prepared, const SceneView& view, const RayAreas<V>& areas) {
  const V sky = all<V>(static_cast<float>(prepared.scene.sky_cd_m2));
  return view.panes.empty() ? sky : through_panes(prepared, view, areas, all<V>(0), sky);
}
template float sky_luminance(const PreparedScene&, const SceneView&, const RayAreas<float>&);
template FloatLanes sky_luminance(const PreparedScene&, const SceneView&, const RayAreas<FloatLanes>&);

template float luminance(const PreparedScene&, const SceneView&, const PatchView&, const RayAreas<float>&);
template FloatLanes luminance(const PreparedScene&, const SceneView&, const PatchView&,
                              const RayAreas<FloatLanes>&);

float luminance(const PreparedScene& prepared, const SceneView& view, const PatchView& patch,
                const PixelRay& ray, float x, float y) {
  const Eigen::Vector3f r = ray.direction(x, y);
  return luminance(prepared, view, patch,
                   RayAreas<float>{r.x(), r.y(), ray.per_column.x(), ray.per_column.y(), ray.per_row.x(),
                                   ray.per_row.y()});
}

}  // namespace evpose::sim
