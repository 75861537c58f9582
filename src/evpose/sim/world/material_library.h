// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "evpose/sim/world/patterns.h"
#include "evpose/sim/world/scene.h"

namespace evpose {
class ThreadPool;
}

namespace evpose::sim {

/// Collects the materials of a scene under construction. All textures are sampled together at the end.
class MaterialLibrary {
 public:
  /// Each returns the material's number.
  std::int32_t add_plain(const std::string& name, double reflectance);
  std::int32_t add_emissive(const std::string& name, double cd_m2, int light);
  /// Patterns are around 0.5: `tone` 1 gives a mean reflectance of 0.5.
  std::int32_t add_textured(const std::string& name, double tone, const Repeat& repeat, double texel_m,
                            Pattern pattern);
  /// Adds emission; `light` as in Material::emission_light.
  void set_emission(std::int32_t material, double cd_m2, int light);
  /// A clear coat; as Material::mirror.
  void set_mirror(std::int32_t material, double reflectance);
  /// The same texture in another tone.
  std::int32_t add_with_tone(const std::string& name, double tone, std::int32_t of);

  /// Samples all textures, with their contrast multiplied by `contrast`, and returns the materials. The same
  /// for any number of threads.
  std::vector<Material> build(double contrast, ThreadPool& pool);

 private:
  struct TextureSpec {
    Repeat repeat;
    double texel_m;
    Pattern pattern;
  };
  std::vector<Material> materials_;
  std::vector<int> texture_of_;  ///< of each material; -1: plain
  std::vector<TextureSpec> textures_;
};

}  // namespace evpose::sim
