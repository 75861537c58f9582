// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "evpose/fusion/state.h"

namespace evpose::map_learn {

/// States of a flight in order of time, at the start and at each update.
using Trajectory = std::vector<FusionState>;

/// The state at a time: pose, velocity and rate between its two neighbours, the rest that of the one before.
/// Times outside of the trajectory give its ends.
FusionState state_at(const Trajectory& trajectory, TimeNs t);

/// Adds errors that are known at some of the states and linear in between. `knots`: numbers of these states,
/// ascending, the first 0; beyond the last the error stays.
void add_at_knots(const std::vector<std::size_t>& knots, const std::vector<Vector15d>& errors,
                  Trajectory& trajectory);

}  // namespace evpose::map_learn
