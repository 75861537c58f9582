// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "evpose/core/error.h"
#include "evpose/io/hdf5/hdf5_file.h"

namespace evpose {

/// Local north-east-down from a map whose x points east, y north and z up, row by row.
inline constexpr std::array<double, 16> kNedFromEnu = {0, 1, 0, 0, 1, 0, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1};

/// Checksum of a map file as a whole: of its datasets' names, shapes and own checksums, and of the attributes
/// of /meta (formats 3).
Expected<std::uint32_t> map_checksum(const Hdf5File& file);

}  // namespace evpose
