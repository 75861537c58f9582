// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

namespace evpose::map_build {

/// Sums over points, for their mean and covariance.
struct Moments {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();
  double count = 0;

  void add(const Eigen::Vector3d& x) {
    sum += x;
    squares += x * x.transpose();
    count += 1;
  }
  void add(const Moments& other) {
    sum += other.sum;
    squares += other.squares;
    count += other.count;
  }
  Eigen::Vector3d mean() const { return sum / count; }
  Eigen::Matrix3d covariance() const {
    const Eigen::Vector3d middle = mean();
    return squares / count - middle * middle.transpose();
  }
};

}  // namespace evpose::map_build
