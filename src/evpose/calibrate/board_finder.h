// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include "evpose/core/error.h"
#include "evpose/io/recording/recording.h"
#include "evpose/map/contour_map.h"
#include "evpose/tracker/tracker.h"

namespace evpose {

/// Two families of evenly spaced lines in one plane: what a checkerboard's map consists of.
struct LineBoard {
  Eigen::Vector3d corner;     ///< where the first lines of both families cross, map frame
  Eigen::Vector3d right, up;  ///< unit, as one looks at it
  double spacing_m = 0;
  int columns = 0, rows = 0;  ///< squares
};

/// None: the map is no checkerboard, or does not say from where it is seen.
std::optional<LineBoard> line_board(const ContourMap& map);

/// The state of the body when a board is first found in the events, without any idea of where it is: lines of
/// events are numbered as those of the board, which gives its pose up to a shift by whole squares; of all
/// shifts, and turns by 90 degrees, that one is taken whose contours meet most events. Polarity tells a turn
/// by 180 degrees apart, where the board's contrast does; else the board is taken to stand upright. Two
/// looks, some milliseconds apart, give the velocity. Errors: those of the reader; the board never comes into
/// view.
Expected<StartState> find_board(const Recording& recording, const ContourMap& map, const LineBoard& board,
                                const Camera& camera);

}  // namespace evpose
