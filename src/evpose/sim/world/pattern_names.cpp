// SPDX-License-Identifier: BSD-3-Clause
#include <utility>

#include "evpose/sim/world/patterns.h"

namespace evpose::sim {
namespace {

using Maker = Pattern (*)(const Repeat& repeat, std::uint64_t seed);

const std::vector<std::pair<std::string, Maker>>& makers() {
  static const std::vector<std::pair<std::string, Maker>> all = {
      {"bricks", bricks},
      {"tiles", [](const Repeat& r, std::uint64_t s) { return tiles(r, 0.3, s); }},
      {"planks", [](const Repeat& r, std::uint64_t s) { return planks(r, 0.14, s); }},
      {"plaster", plaster},
      {"wallpaper", wallpaper},
      {"ceiling_panels", ceiling_panels},
      {"marble", marble},
      {"carpet", carpet},
      {"cloth", cloth},
      {"paving", paving},
      {"asphalt", asphalt},
      {"gravel", gravel},
      {"grass", grass},
      {"concrete", concrete},
      {"stucco", stucco},
      {"graffiti", graffiti},
      {"window_panes", [](const Repeat& r, std::uint64_t s) { return window_panes(r, 0.55, s); }},
      {"poster", poster},
      {"carton", carton},
      {"book_spines", [](const Repeat& r, std::uint64_t s) { return book_spines(r, 0.3, s); }},
      {"screen_text", screen_text},
      {"container_side", container_side}};
  return all;
}

}  // namespace

Pattern named_pattern(const std::string& name, const Repeat& repeat, std::uint64_t seed) {
  for (const auto& [known, make] : makers())
    if (known == name) return make(repeat, seed);
  return {};
}

std::vector<std::string> pattern_names() {
  std::vector<std::string> names;
  for (const auto& maker : makers()) names.push_back(maker.first);
  return names;
}

}  // namespace evpose::sim
