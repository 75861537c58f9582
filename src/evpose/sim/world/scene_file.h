// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "evpose/core/error.h"
#include "evpose/sim/world/scene.h"
#include "evpose/sim/world/worlds.h"

namespace evpose {
class ThreadPool;
}

namespace evpose::sim {

/// Reads a scene from YAML (docs/use/simulator.md, section "Own scenes"): own bodies, meshes, lights and
/// moving objects, alone or in a built-in world. `world` has the default settings of that world; `base` in
/// the file overrides them. Errors name file, line and key.
Expected<Scene> read_scene(const std::string& path, const WorldConfig& world, ThreadPool& pool);

}  // namespace evpose::sim
