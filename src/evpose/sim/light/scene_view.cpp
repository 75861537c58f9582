// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/light/scene_view.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "evpose/sim/world/texture.h"

namespace evpose::sim {
namespace {

constexpr std::size_t kMostChannels = 16;

// Illuminance of the light map, each channel weighted by its factor.
float baked_light(const LightMap& map, const std::vector<float>& factors, float right, float up) {
  const auto per_metre = static_cast<float>(map.per_metre);
  const float x = std::clamp(right * per_metre, 0.0F, static_cast<float>(map.columns - 1));
  const float y = std::clamp(up * per_metre, 0.0F, static_cast<float>(map.rows - 1));
  const int i = std::min(static_cast<int>(x), std::max(map.columns - 2, 0)),
            j = std::min(static_cast<int>(y), std::max(map.rows - 2, 0));
  const int di = map.columns > 1 ? 1 : 0, dj = map.rows > 1 ? map.columns : 0;
  const float a = x - static_cast<float>(i), b = y - static_cast<float>(j);
  const std::size_t texels = static_cast<std::size_t>(map.columns) * map.rows;
  const float* value = &map.values[static_cast<std::size_t>(j) * map.columns + i];
  float sum = 0;
  for (const float factor : factors) {
    const float low = value[0] + a * (value[di] - value[0]);
    const float high = value[dj] + a * (value[dj + di] - value[dj]);
    sum += factor * (low + b * (high - low));
    value += texels;
  }
  return sum;
}

float moving_light(const PreparedScene& prepared, const SceneView& view, const PatchView& patch,
                   const Eigen::Vector3f& ray_cam, float depth) {
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

}  // namespace

SceneView make_scene_view(const PreparedScene& prepared, double t_s, const Pose& T_map_cam) {
  EVPOSE_CHECK(prepared.channels.switching.size() <= kMostChannels);
  SceneView view{t_s, T_map_cam, T_map_cam.rotation(), prepared.channels.factors(t_s), {}, {}};
  for (const MovingPart& part : prepared.scene.moving) {
    view.T_map_part.push_back(part.T_map_part(t_s));
    view.T_part_cam.push_back(view.T_map_part.back().inverse() * T_map_cam);
  }
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
  return view;
}

PatchView make_patch_view(const SceneView& view, const Patch& patch, int part) {
  const Eigen::Vector3d origin = part < 0 ? view.T_map_cam.p : view.T_part_cam[part].p;
  const Eigen::Matrix3d R = (part < 0 ? view.R_map_cam : view.T_part_cam[part].rotation()).transpose();
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

float luminance(const PreparedScene& prepared, const SceneView& view, const PatchView& patch,
                const PixelRay& ray, float x, float y) {
  const Eigen::Vector3f r = ray.direction(x, y);
  const float inverse = 1 / patch.normal.dot(r), depth = patch.reach * inverse;
  const Material& material = prepared.scene.materials[patch.patch->material];
  auto reflectance = static_cast<float>(material.reflectance);
  if (material.texture) {
    const float along_u = patch.u_axis.dot(r), along_v = patch.v_axis.dot(r);
    const auto change = [&](const Eigen::Vector2f& step) -> Eigen::Vector2f {
      const float turn = patch.normal.head<2>().dot(step) * inverse;
      return {depth * (patch.u_axis.head<2>().dot(step) - along_u * turn),
              depth * (patch.v_axis.head<2>().dot(step) - along_v * turn)};
    };
    reflectance *= material.texture->mean(patch.u + depth * along_u, patch.v + depth * along_v,
                                          change(ray.per_column), change(ray.per_row));
  }
  const LightMap& map = patch.patch->light;
  const float lux = map.columns > 0 ? baked_light(map, view.light, patch.right0 + depth * patch.right.dot(r),
                                                  patch.up0 + depth * patch.up.dot(r))
                                    : moving_light(prepared, view, patch, r, depth);
  auto emission = static_cast<float>(material.emission_cd_m2);
  if (emission > 0 && material.emission_light >= 0)
    emission *= view.light[prepared.channels.of_light[material.emission_light]];
  return reflectance * lux * std::numbers::inv_pi_v<float> + emission;
}

}  // namespace evpose::sim
