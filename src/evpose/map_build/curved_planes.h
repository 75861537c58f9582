// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "evpose/map_build/planes.h"

namespace evpose::map_build {

/// For each plane whether its points bend like a cylinder, by more than the noise and over an angle that
/// matters: a facet of a column, pipe or vault.
std::vector<bool> find_curved(const SurfacePoints& surface, const Planes& planes);

}  // namespace evpose::map_build
