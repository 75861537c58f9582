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

/// The materials of a scene that is being laid out. Their textures are sampled together at the end.
class MaterialShelf {
 public:
  /// Each returns the material's number.
  std::int32_t add_plain(const std::string& name, double reflectance);
  std::int32_t add_glowing(const std::string& name, double cd_m2, int light);
  /// Patterns are around 0.5: `tone` 1 gives a mean reflectance of 0.5.
  std::int32_t add_textured(const std::string& name, double tone, const Repeat& repeat, double texel_m,
                            Pattern pattern);
  /// Light of its own besides; `light` as in Material::emission_light.
  void make_glow(std::int32_t material, double cd_m2, int light);
  /// The same texture in another tone.
  std::int32_t add_toned(const std::string& name, double tone, std::int32_t of);

  /// Samples all textures, with their contrast times `contrast`, and hands the materials out. The same for
  /// any number of threads.
  std::vector<Material> take(double contrast, ThreadPool& pool);

 private:
  struct Sheet {
    Repeat repeat;
    double texel_m;
    Pattern pattern;
  };
  std::vector<Material> materials_;
  std::vector<int> sheet_of_;  ///< of each material; -1: plain
  std::vector<Sheet> sheets_;
};

}  // namespace evpose::sim
