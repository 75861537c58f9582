// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/view_agreement.h"

#include <Eigen/Cholesky>
#include <vector>

namespace evpose {

double view_distance2(const Eigen::VectorXd& moved, const Eigen::VectorXd& moved_before,
                      const Eigen::MatrixXd& of_view, const Eigen::Matrix3d& of_velocity, double since_s) {
  std::vector<Eigen::Index> kept{0, 1, 2, 3, 4, 5};  // without the velocity, which changes
  for (Eigen::Index i = 9; i < moved.size(); ++i) kept.push_back(i);
  Eigen::MatrixXd covariance = 2 * of_view(kept, kept);
  covariance.topLeftCorner<3, 3>() += since_s * since_s * of_velocity;
  const Eigen::VectorXd d = (moved - moved_before)(kept);
  return d.dot(covariance.ldlt().solve(d)) / static_cast<double>(d.size());
}

}  // namespace evpose
