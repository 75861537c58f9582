// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <vector>

#include "evpose/calibrate/event_lines.h"

namespace evpose {

/// A line with its number in a family of evenly spaced parallel lines, as seen in perspective.
struct NumberedLine {
  EventLine line;
  int number = 0;
};

/// Numbers the lines of one family (those whose normals are within half a right angle of `towards`) in the
/// direction of `towards`, from 0 on. Places along a line across the family are a projective function of the
/// number, which three lines tell; the numbering that most lines agree with is taken, and lines that do not
/// agree are left out. Empty: fewer than four agree.
std::vector<NumberedLine> number_lines(std::span<const EventLine> lines, const Eigen::Vector2d& towards,
                                       const Eigen::Vector2d& middle);

}  // namespace evpose
