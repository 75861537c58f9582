// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>

namespace evpose {

/// Smallest angle in (0, end_rad] where `growth`, positive at the axis, is no longer positive: there the
/// projection folds back on itself. `end_rad` if there is none. Looks every 0.01 degree, then bisects.
double fold_angle(const std::function<double(double angle_rad)>& growth, double end_rad);

}  // namespace evpose
