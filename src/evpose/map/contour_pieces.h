// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "evpose/map/contour_map.h"

namespace evpose {

/// Contours cut into short pieces, each of which looks much the same along its length: what is learnt about a
/// contour (its contrast) is learnt per piece.
struct ContourPieces {
  std::vector<std::uint32_t> of_point;  ///< piece of each map point
  std::uint32_t count = 0;
};

/// Points belong to one piece if they lie on one contour (the map's number, or, without one, a chain of close
/// points on one line and one plane) and in one cube of edge `piece_m`.
ContourPieces cut_contours(const ContourMap& map, double piece_m = 0.12);

}  // namespace evpose
