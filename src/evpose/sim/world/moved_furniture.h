// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "evpose/core/error.h"
#include "evpose/sim/world/scene.h"

namespace evpose::sim {

/// The scene with `count` pieces of its furniture moved by 5 to 50 cm and turned by up to 10 degrees on the
/// floor, not into anything else. Errors: fewer pieces than that have room to move.
Expected<Scene> with_moved_furniture(const Scene& scene, int count, std::uint64_t seed);

}  // namespace evpose::sim
