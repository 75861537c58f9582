// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "evpose/core/error.h"
#include "evpose/io/maps/point_table.h"

namespace evpose {

/// PCD 0.7: ascii, binary, binary_compressed. A field with COUNT n > 1 becomes columns name_0 .. name_n-1.
/// VIEWPOINT is handed on, unless it is the origin: writers put that where they know none, merged clouds
/// included. Rows whose x, y or z is not finite mark absent points: they are dropped, with one warning that
/// counts them.
Expected<PointTable> read_pcd(const std::string& path);
/// All rows, absent points included, as one block.
Status visit_pcd(const std::string& path, const PointBlocks& visit);

}  // namespace evpose
