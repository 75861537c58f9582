// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "evpose/core/error.h"
#include "evpose/sim/light/surfaces.h"

namespace evpose::sim {

/// Worlds that were made before: the light on their still surfaces and their true contours, which cost as
/// much as some tenths of a second of flight. A world is known by all that these are made of (mesh, lights,
/// spacing of the contours) and by the program that made them: another build makes it anew.
class WorldCache {
 public:
  /// `folder`: where worlds are kept, one folder each; empty: nowhere.
  explicit WorldCache(std::string folder) : folder_(std::move(folder)) {}

  struct World {
    std::vector<LightMap> light;  ///< of the patches of the still mesh
    std::size_t contour_points = 0;
    std::string contours, mesh;  ///< paths of both PLY files
  };
  /// None where it was not kept, or where its files are damaged.
  std::optional<World> find(const Scene& scene, double contour_spacing_m) const;
  /// Copies the files. Errors: the folder cannot be written.
  Status keep(const Scene& scene, double contour_spacing_m, const PartSurfaces& still,
              const World& files) const;

 private:
  std::string folder_;
};

}  // namespace evpose::sim
