// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

namespace evpose {

/// Whether points lie on surfaces rather than along lines: the number of neighbours within twice the distance
/// is four times as large on a surface, twice on a line. By the median of a sample, at three and six times
/// the spacing; few points are never taken for a surface. Positions within 1e7 m.
bool lies_on_surfaces(const std::vector<Eigen::Vector3f>& points);

}  // namespace evpose
