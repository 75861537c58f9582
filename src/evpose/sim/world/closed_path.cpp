// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/world/closed_path.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

#include "evpose/core/error.h"

namespace evpose::sim {
namespace {

constexpr int kDegree = 5;
constexpr int kStepsPerPoint = 8;

// The degree + 1 uniform B-splines of a degree that are not zero at `x` in [0, 1) after a knot, in order.
std::array<double, kDegree + 1> basis(int degree, double x) {
  std::array<double, kDegree + 1> b{};
  b[0] = 1;
  for (int d = 1; d <= degree; ++d) {
    for (int i = d; i >= 0; --i) {
      // The i-th of degree d begins d - i knots before.
      const double since = x + d - i, until = 1 + i - x;
      const double left = i > 0 ? b[static_cast<std::size_t>(i - 1)] : 0;
      const double right = i < d ? b[static_cast<std::size_t>(i)] : 0;
      b[static_cast<std::size_t>(i)] = (since * left + until * right) / d;
    }
  }
  return b;
}

}  // namespace

ClosedPath::ClosedPath(const std::vector<Eigen::Vector3d>& points) {
  EVPOSE_CHECK(points.size() >= 3);
  const auto n = static_cast<Eigen::Index>(points.size());
  // Control points such that the curve passes the points at the knots.
  const auto at_knot = basis(kDegree, 0);
  Eigen::MatrixXd system = Eigen::MatrixXd::Zero(n, n);
  Eigen::MatrixXd values(n, 3);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (int k = 0; k <= kDegree; ++k) system(i, (i + k) % n) += at_knot[static_cast<std::size_t>(k)];
    values.row(i) = points[static_cast<std::size_t>(i)].transpose();
  }
  const Eigen::MatrixXd controls = system.fullPivLu().solve(values);
  for (Eigen::Index i = 0; i < n; ++i) controls_.emplace_back(controls.row(i).transpose());
  lengths_.push_back(0);
  const int steps = kStepsPerPoint * static_cast<int>(n);
  for (int i = 0; i < steps; ++i)
    lengths_.push_back(lengths_.back() + stretch(static_cast<double>(i) / kStepsPerPoint,
                                                 static_cast<double>(i + 1) / kStepsPerPoint));
}

Eigen::Vector3d ClosedPath::derivative(double parameter, int order) const {
  const auto n = static_cast<int>(controls_.size());
  const double floor = std::floor(parameter);
  const auto at = basis(kDegree - order, parameter - floor);
  const auto control = [&](int i) {
    const int index = (static_cast<int>(floor) + i) % n;
    return controls_[static_cast<std::size_t>(index < 0 ? index + n : index)];
  };
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int i = 0; i <= kDegree - order; ++i)
    sum += at[static_cast<std::size_t>(i)] *
           (order == 0 ? control(i) : Eigen::Vector3d(control(i + 1) - control(i)));
  return sum;
}

// Length between two parameters not farther apart than a step, by Gauss and Legendre.
double ClosedPath::stretch(double from, double to) const {
  constexpr std::array<double, 5> kNodes = {-0.9061798459386640, -0.5384693101056831, 0, 0.5384693101056831,
                                            0.9061798459386640};
  constexpr std::array<double, 5> kWeights = {0.2369268850561891, 0.4786286704993665, 0.5688888888888889,
                                              0.4786286704993665, 0.2369268850561891};
  double sum = 0;
  for (std::size_t i = 0; i < kNodes.size(); ++i)
    sum += kWeights[i] * derivative(0.5 * (from + to) + 0.5 * (to - from) * kNodes[i], 1).norm();
  return 0.5 * (to - from) * sum;
}

ClosedPath::At ClosedPath::at(double distance_m) const {
  const double s = distance_m - length_m() * std::floor(distance_m / length_m());
  const auto after = std::upper_bound(lengths_.begin() + 1, lengths_.end() - 1, s);
  const auto step = static_cast<std::size_t>(after - lengths_.begin()) - 1;
  const double from = static_cast<double>(step) / kStepsPerPoint;
  double parameter = from + (s - lengths_[step]) / (lengths_[step + 1] - lengths_[step]) / kStepsPerPoint;
  for (int i = 0; i < 4; ++i)
    parameter -= (lengths_[step] + stretch(from, parameter) - s) / derivative(parameter, 1).norm();
  return {derivative(parameter, 0), derivative(parameter, 1).normalized()};
}

}  // namespace evpose::sim
