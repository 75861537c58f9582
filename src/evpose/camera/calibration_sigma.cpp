// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/camera/calibration_sigma.h"

#include <algorithm>

namespace evpose {
namespace {

/// Of an ordinary calibration; the focal lengths' are relative.
constexpr double kFocal = 3e-3, kCentre_px = 1, kFirstRadial = 0.01, kRadial = 0.02, kTangential = 5e-4;
/// Of the ratio of both focal lengths, relative: pixels are square, and whatever a calibration takes for a
/// longer lens lengthens both.
constexpr double kAspect = 1e-3;

Eigen::VectorXd ordinary(const CameraIntrinsics& c) {
  Eigen::VectorXd sigma(4 + static_cast<Eigen::Index>(c.distortion.size()));
  sigma.head<4>() << kFocal * c.fx, kFocal * c.fy, kCentre_px, kCentre_px;
  for (Eigen::Index i = 4; i < sigma.size(); ++i) sigma(i) = i == 4 ? kFirstRadial : kRadial;
  if (c.distortion_model == "radtan") sigma.segment<2>(6).setConstant(kTangential);
  if (c.distortion_model == "ds") sigma.tail<2>().setConstant(kFirstRadial);
  return sigma;
}

/// Of errors of fx and fy that are as large as this, relative.
double correlation_of_focal_lengths(double x, double y) {
  constexpr double kMost = 0.999;
  return x > 0 && y > 0 ? std::clamp((x * x + y * y - kAspect * kAspect) / (2 * x * y), 0.0, kMost) : 0;
}

}  // namespace

CalibrationSigma CalibrationSigma::known(const CameraIntrinsics& camera) {
  return {std::vector<double>(4),
          std::vector<double>(camera.distortion.size()),
          Eigen::Vector3d::Zero(),
          Eigen::Vector3d::Zero(),
          0,
          {}};
}

Eigen::MatrixXd CalibrationSigma::of_correlation(const CameraIntrinsics& camera) const {
  const auto n = 4 + static_cast<Eigen::Index>(camera.distortion.size());
  Eigen::MatrixXd out = Eigen::MatrixXd::Identity(n + 7, n + 7);
  if (!correlation) {
    const Eigen::VectorXd sigma = of_intrinsics(camera);
    out(0, 1) = out(1, 0) = correlation_of_focal_lengths(sigma(0) / camera.fx, sigma(1) / camera.fy);
  }
  if (correlation && (correlation->rows() == n || correlation->rows() == n + 7))
    out.topLeftCorner(correlation->rows(), correlation->rows()) = *correlation;
  return out;
}

Eigen::VectorXd CalibrationSigma::of_intrinsics(const CameraIntrinsics& camera) const {
  Eigen::VectorXd sigma = ordinary(camera);
  if (intrinsics && intrinsics->size() == 4) std::copy(intrinsics->begin(), intrinsics->end(), sigma.begin());
  if (distortion && distortion->size() == camera.distortion.size())
    std::copy(distortion->begin(), distortion->end(), sigma.begin() + 4);
  return sigma;
}

}  // namespace evpose
