// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/world/material_library.h"

#include <algorithm>
#include <memory>
#include <numeric>
#include <utility>

#include "evpose/core/parallel.h"
#include "evpose/sim/world/texture.h"

namespace evpose::sim {

std::int32_t MaterialLibrary::add_plain(const std::string& name, double reflectance) {
  Material& material = materials_.emplace_back();
  material.name = name;
  material.reflectance = reflectance;
  texture_of_.push_back(-1);
  return static_cast<std::int32_t>(materials_.size() - 1);
}

std::int32_t MaterialLibrary::add_emissive(const std::string& name, double cd_m2, int light) {
  const std::int32_t material = add_plain(name, 0.5);
  set_emission(material, cd_m2, light);
  return material;
}

void MaterialLibrary::set_emission(std::int32_t material, double cd_m2, int light) {
  Material& own = materials_[static_cast<std::size_t>(material)];
  own.emission_cd_m2 = cd_m2;
  own.emission_light = light;
}

void MaterialLibrary::set_mirror(std::int32_t material, double reflectance) {
  materials_[static_cast<std::size_t>(material)].mirror = reflectance;
}

std::int32_t MaterialLibrary::add_textured(const std::string& name, double tone, const Repeat& repeat,
                                           double texel_m, Pattern pattern) {
  const std::int32_t material = add_plain(name, tone);
  texture_of_.back() = static_cast<int>(textures_.size());
  textures_.push_back({repeat, texel_m, std::move(pattern)});
  return material;
}

std::int32_t MaterialLibrary::add_with_tone(const std::string& name, double tone, std::int32_t of) {
  const std::int32_t material = add_plain(name, tone);
  texture_of_.back() = texture_of_[static_cast<std::size_t>(of)];
  return material;
}

std::vector<Material> MaterialLibrary::build(double contrast, ThreadPool& pool) {
  std::vector<std::size_t> order(textures_.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  const auto texels = [&](std::size_t i) {
    return textures_[i].repeat.width_m * textures_[i].repeat.height_m /
           (textures_[i].texel_m * textures_[i].texel_m);
  };
  // The largest first, so that all threads finish at about the same time.
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return texels(a) > texels(b); });
  std::vector<std::shared_ptr<const Texture>> textures(textures_.size());
  pool.for_chunks(order.size(), 1, [&](std::size_t, std::size_t begin, std::size_t) {
    const TextureSpec& sheet = textures_[order[begin]];
    textures[order[begin]] = std::make_shared<const Texture>(
        sheet.repeat.width_m, sheet.repeat.height_m, sheet.texel_m, with_contrast(sheet.pattern, contrast));
  });
  for (std::size_t i = 0; i < materials_.size(); ++i)
    if (texture_of_[i] >= 0) materials_[i].texture = textures[static_cast<std::size_t>(texture_of_[i])];
  return std::move(materials_);
}

}  // namespace evpose::sim
