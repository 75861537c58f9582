// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/eval/alignment.h"

#include <Eigen/SVD>
#include <cmath>

#include "evpose/core/error.h"

namespace evpose {
namespace {

Eigen::Vector3d mean(std::span<const Eigen::Vector3d> points) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const auto& x : points) sum += x;
  return sum / static_cast<double>(points.size());
}

}  // namespace

const char* to_string(Alignment alignment) {
  switch (alignment) {
    case Alignment::none:
      return "none";
    case Alignment::se3:
      return "se3";
    case Alignment::yaw:
      return "yaw";
    case Alignment::sim3:
      return "sim3";
  }
  return "";
}

Matrix6d Similarity::covariance(const Matrix6d& of_pose) const {
  Matrix6d J = Matrix6d::Identity();
  J.topLeftCorner<3, 3>() = scale * q.toRotationMatrix();
  return J * of_pose * J.transpose();
}

Similarity align(std::span<const Eigen::Vector3d> from, std::span<const Eigen::Vector3d> to, Alignment kind) {
  EVPOSE_CHECK(from.size() == to.size());
  Similarity out;
  if (kind == Alignment::none || from.empty()) return out;
  const Eigen::Vector3d mean_from = mean(from), mean_to = mean(to);
  Eigen::Matrix3d moment = Eigen::Matrix3d::Zero();  // of to (rows) and from (columns)
  double spread = 0;
  for (std::size_t i = 0; i < from.size(); ++i) {
    const Eigen::Vector3d a = from[i] - mean_from;
    moment += (to[i] - mean_to) * a.transpose();
    spread += a.squaredNorm();
  }
  if (kind == Alignment::yaw) {
    const double angle = std::atan2(moment(1, 0) - moment(0, 1), moment(0, 0) + moment(1, 1));
    out.q = Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ());
  } else {
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(moment, Eigen::ComputeFullU | Eigen::ComputeFullV);
    const double hand = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1;
    const Eigen::Vector3d signs(1, 1, hand);
    out.q = Eigen::Matrix3d(svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose());
    out.q.normalize();
    if (kind == Alignment::sim3 && spread > 0) out.scale = svd.singularValues().dot(signs) / spread;
  }
  out.p = mean_to - out.scale * (out.q * mean_from);
  return out;
}

}  // namespace evpose
