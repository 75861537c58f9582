// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

namespace evpose::sim {

/// Side of a box: axis 0..2, times two, plus one for the side at +half.
using BoxSide = int;
inline int axis_of(BoxSide side) { return side >> 1; }
inline double sign_of(BoxSide side) { return side & 1 ? 1.0 : -1.0; }

/// Where a ray meets a box: origin + distance * direction, `distance` in lengths of the direction.
struct BoxHit {
  double distance = 0;
  BoxSide side = -1;  ///< -1: not met
};

/// First meeting at a distance in (0, nearest) with the box |p_i| <= half_i, all in the box's frame. From
/// outside that is where the ray enters, from inside where it leaves.
inline BoxHit hit_box(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                      const Eigen::Vector3d& half, double nearest) {
  double enter = -nearest, leave = nearest;
  BoxSide enter_side = -1, leave_side = -1;
  for (int axis = 0; axis < 3; ++axis) {
    if (direction[axis] == 0) {
      if (!(origin[axis] > -half[axis] && origin[axis] < half[axis])) return {};
      continue;
    }
    const double inverse = 1 / direction[axis];
    const double to_middle = -origin[axis] * inverse,
                 half_way = half[axis] * (inverse < 0 ? -inverse : inverse);
    const bool forward = inverse > 0;
    if (to_middle - half_way > enter) {
      enter = to_middle - half_way;
      enter_side = 2 * axis + (forward ? 0 : 1);
    }
    if (to_middle + half_way < leave) {
      leave = to_middle + half_way;
      leave_side = 2 * axis + (forward ? 1 : 0);
    }
  }
  if (!(enter < leave)) return {};
  if (enter > 0) return {enter, enter_side};
  return leave > 0 ? BoxHit{leave, leave_side} : BoxHit{};
}

}  // namespace evpose::sim
