// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "evpose/core/error.h"

namespace evpose {

/// Grey pictures, rows from the top. Faults of ours: an empty picture, a size that does not fit.
Status write_png_grey8(const std::string& path, int width, int height,
                       const std::vector<std::uint8_t>& pixels);
Status write_png_grey16(const std::string& path, int width, int height,
                        const std::vector<std::uint16_t>& pixels);

}  // namespace evpose
