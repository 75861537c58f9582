// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "evpose/core/error.h"
#include "evpose/io/maps/point_table.h"

namespace evpose {

/// LAS 1.0 .. 1.4, point formats 0 .. 10: columns x, y, z and intensity (ASPRS LAS 1.4-R15). Compressed files
/// (LAZ) are an error that names the way out.
Expected<PointTable> read_las(const std::string& path);
/// The same in blocks, so that the memory does not grow with the file.
Status visit_las(const std::string& path, const PointBlocks& visit);

}  // namespace evpose
