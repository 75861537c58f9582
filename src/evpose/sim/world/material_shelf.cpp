// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/world/material_shelf.h"

#include <algorithm>
#include <memory>
#include <numeric>
#include <utility>

#include "evpose/core/parallel.h"
#include "evpose/sim/world/texture.h"

namespace evpose::sim {

std::int32_t MaterialShelf::add_plain(const std::string& name, double reflectance) {
  Material& material = materials_.emplace_back();
  material.name = name;
  material.reflectance = reflectance;
  sheet_of_.push_back(-1);
  return static_cast<std::int32_t>(materials_.size() - 1);
}

std::int32_t MaterialShelf::add_glowing(const std::string& name, double cd_m2, int light) {
  const std::int32_t material = add_plain(name, 0.5);
  make_glow(material, cd_m2, light);
  return material;
}

void MaterialShelf::make_glow(std::int32_t material, double cd_m2, int light) {
  Material& own = materials_[static_cast<std::size_t>(material)];
  own.emission_cd_m2 = cd_m2;
  own.emission_light = light;
}

std::int32_t MaterialShelf::add_textured(const std::string& name, double tone, const Repeat& repeat,
                                         double texel_m, Pattern pattern) {
  const std::int32_t material = add_plain(name, tone);
  sheet_of_.back() = static_cast<int>(sheets_.size());
  sheets_.push_back({repeat, texel_m, std::move(pattern)});
  return material;
}

std::int32_t MaterialShelf::add_toned(const std::string& name, double tone, std::int32_t of) {
  const std::int32_t material = add_plain(name, tone);
  sheet_of_.back() = sheet_of_[static_cast<std::size_t>(of)];
  return material;
}

std::vector<Material> MaterialShelf::take(double contrast, ThreadPool& pool) {
  std::vector<std::size_t> order(sheets_.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  const auto texels = [&](std::size_t i) {
    return sheets_[i].repeat.width_m * sheets_[i].repeat.height_m / (sheets_[i].texel_m * sheets_[i].texel_m);
  };
  // The largest first, so that no thread is left alone with one at the end.
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return texels(a) > texels(b); });
  std::vector<std::shared_ptr<const Texture>> textures(sheets_.size());
  pool.for_chunks(order.size(), 1, [&](std::size_t, std::size_t begin, std::size_t) {
    const Sheet& sheet = sheets_[order[begin]];
    textures[order[begin]] = std::make_shared<const Texture>(
        sheet.repeat.width_m, sheet.repeat.height_m, sheet.texel_m, with_contrast(sheet.pattern, contrast));
  });
  for (std::size_t i = 0; i < materials_.size(); ++i)
    if (sheet_of_[i] >= 0) materials_[i].texture = textures[static_cast<std::size_t>(sheet_of_[i])];
  return std::move(materials_);
}

}  // namespace evpose::sim
