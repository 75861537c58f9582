// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

namespace evpose::sim {

/// A closed curve through points with four continuous derivatives, parametrized by arc length: motion along
/// it at constant speed has no jerk.
class ClosedPath {
 public:
  /// At least three points, metres, neighbours apart from each other.
  explicit ClosedPath(const std::vector<Eigen::Vector3d>& points);

  double length_m() const { return lengths_.back(); }
  struct At {
    Eigen::Vector3d position, tangent;  ///< metres; unit
  };
  /// At any distance along it, modulo its length.
  At at(double distance_m) const;

 private:
  Eigen::Vector3d derivative(double parameter, int order) const;
  double stretch(double from, double to) const;

  std::vector<Eigen::Vector3d> controls_;
  std::vector<double> lengths_;  ///< up to each step of the parameter
};

}  // namespace evpose::sim
