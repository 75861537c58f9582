// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/event/event_preprocessor.h"

namespace evpose {

/// A straight line of events: normal . pixel = offset.
struct EventLine {
  Eigen::Vector2d normal;  ///< unit, to the right or straight down
  double offset = 0;       ///< px
  int pixels = 0;          ///< that lie on it
};

/// The straight lines in a slice of events, most pixels first. A lens that bends lines by some pixels costs
/// their ends.
std::vector<EventLine> find_event_lines(std::span<const FilteredEvent> events, ImageSize size);

/// Where a line crosses another; far away where they are nearly parallel.
Eigen::Vector2d crossing(const EventLine& a, const EventLine& b);

}  // namespace evpose
