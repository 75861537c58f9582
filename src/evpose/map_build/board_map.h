// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "evpose/core/error.h"
#include "evpose/map/board.h"
#include "evpose/map/contour_map.h"

namespace evpose {

/// The contours of a printed board with their exact places and contrast. Errors: counts below two or above a
/// thousand, sizes that are not positive, discs that touch.
Expected<ContourMap> board_map(const Board& board);

/// How the board may be turned without looking any different, in words; empty if it may not.
std::string board_symmetry(const Board& board);

}  // namespace evpose
