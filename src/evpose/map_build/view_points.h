// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "evpose/map_build/planes.h"

namespace evpose::map_build {

/// What stands nearest in every direction from a place that the cloud was seen from.
class View {
 public:
  /// `eye` and points relative to the cloud's anchor; the points are copied as far as they are nearest.
  View(const Eigen::Vector3d& eye, std::span<const Eigen::Vector3f> points);

  /// Something off the plane stands before x, nearer by more than `margin_m`.
  bool hides(const Eigen::Vector3d& x, const FittedPlane& plane, double margin_m) const;

 private:
  struct Cell {
    Eigen::Index face, column, row;
  };
  Cell cell_of(const Eigen::Vector3f& direction) const;
  std::size_t number(Eigen::Index face, Eigen::Index column, Eigen::Index row) const {
    return static_cast<std::size_t>((face * side_ + row) * side_ + column);
  }

  Eigen::Vector3d eye_;
  Eigen::Index side_;                     ///< cells along a side of the cube around the eye
  std::vector<Eigen::Vector3f> nearest_;  ///< from the eye; zero where there is nothing
};

/// Hidden from all of them, if there are any: whether the surface ends at x, nobody has seen.
bool hidden_from_all(std::span<const View> views, const Eigen::Vector3d& x, const FittedPlane& plane,
                     double margin_m);

}  // namespace evpose::map_build
