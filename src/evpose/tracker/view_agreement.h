// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

namespace evpose {

/// How far two views are apart that were found from different events, one after the other, in the covariance
/// of their difference: squared, over its degrees of freedom; about 1 if it is the same view. Each is what a
/// prior was moved by in pose (as Pose::plus), velocity and the camera's numbers. In between the IMU has
/// carried the prior on for `since_s`, with the error of its velocity. `of_view`: covariance of a view;
/// `of_velocity`: of the prior's velocity, (m/s)^2.
double view_distance2(const Eigen::VectorXd& moved, const Eigen::VectorXd& moved_before,
                      const Eigen::MatrixXd& of_view, const Eigen::Matrix3d& of_velocity, double since_s);

}  // namespace evpose
