// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/calibrate/image_modes.h"

#include <Eigen/QR>
#include <cmath>
#include <utility>

namespace evpose {

ImageModes image_modes(const CameraIntrinsics& camera, Eigen::Index n) {
  const double corner_px = 0.5 * std::hypot(camera.size.width, camera.size.height), r = corner_px / camera.fx;
  ImageModes out;
  for (Eigen::VectorXd* mode : {&out.focal, &out.cx, &out.cy, &out.roll}) mode->setZero(n + 1);
  out.focal(0) = camera.fx / corner_px;
  out.focal(1) = camera.fy / corner_px;
  out.cx(2) = out.cy(3) = 1;
  out.roll(n) = 1 / corner_px;
  // Double sphere has a shape of its own: it is left to the alignment.
  if (n < 6 || camera.distortion_model == "ds") return out;
  // 3 (r^3 - 2/3 r) and 10 (r^5 - 6/5 r^3 + 3/10 r), at most 1 in between.
  const Eigen::VectorXd cube = Eigen::VectorXd::Unit(n + 1, 4) / (corner_px * r * r),
                        fifth = Eigen::VectorXd::Unit(n + 1, 5) / (corner_px * r * r * r * r);
  out.cubic = 3 * (cube - 2.0 / 3 * out.focal);
  out.quintic = 10 * (fifth - 1.2 * cube + 0.3 * out.focal);
  return out;
}

Eigen::MatrixXd covariance_of_found(const ImageModes& modes, const CameraIntrinsics& camera,
                                    const CalibrationSigma& given, const Eigen::Quaterniond& R_body_cam,
                                    const ImageSigma& image) {
  const Eigen::VectorXd sigma = given.of_intrinsics(camera);
  const Eigen::Index n = sigma.size();
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(n + 7, n + 7);
  const auto add = [&out](const Eigen::VectorXd& off) { out += off * off.transpose(); };
  const auto numbers = [n](const Eigen::VectorXd& mode) {
    Eigen::VectorXd off = Eigen::VectorXd::Zero(n + 7);
    off.head(n) = mode.head(n);
    return off;
  };
  const std::pair<const Eigen::VectorXd&, double> known[] = {{modes.focal, image.focal_px},
                                                             {modes.cx, image.centre_px},
                                                             {modes.cy, image.centre_px},
                                                             {modes.cubic, image.cubic_px},
                                                             {modes.quintic, image.quintic_px}};
  for (const auto& [mode, sigma_px] : known)
    if (mode.size() > 0) add(sigma_px * numbers(mode));
  for (Eigen::Index i = 4; i < n; ++i)
    if (out(i, i) == 0) out(i, i) = sigma(i) * sigma(i);
  // Of fx / fy, by what was given.
  const Eigen::Vector2d relative{sigma(0) / camera.fx, sigma(1) / camera.fy};
  const double r = given.of_correlation(camera)(0, 1);
  const double aspect =
      std::sqrt(std::max(0.0, relative.squaredNorm() - 2 * r * relative.x() * relative.y()));
  Eigen::VectorXd off = Eigen::VectorXd::Zero(n + 7);
  off.head<2>() << 0.5 * aspect * camera.fx, -0.5 * aspect * camera.fy;
  add(off);
  // True R_body_cam = turn * given: what is seen turns by the inverse.
  const Eigen::Matrix3d R_cam_body = R_body_cam.conjugate().toRotationMatrix();
  const Eigen::Vector3d turn_sigma_rad = given.of_rotation_rad();
  for (int i = 0; i < 3; ++i) {
    off.setZero();
    off(n + i) = turn_sigma_rad(i);
    off(2) = turn_sigma_rad(i) * camera.fx * R_cam_body(1, i);
    off(3) = -turn_sigma_rad(i) * camera.fy * R_cam_body(0, i);
    add(off);
  }
  // The numbers themselves are no further off than given.
  const Eigen::MatrixXd by_numbers = out.leftCols(n);
  const Eigen::MatrixXd of_given =
      sigma.asDiagonal() * given.of_correlation(camera).topLeftCorner(n, n) * sigma.asDiagonal();
  const Eigen::MatrixXd both = by_numbers.topRows(n) + of_given;
  out -= by_numbers * both.completeOrthogonalDecomposition().solve(by_numbers.transpose());
  out.diagonal().segment<3>(n + 3) = given.of_translation_m().cwiseAbs2();
  out(n + 6, n + 6) = given.of_time_s() * given.of_time_s();
  return out;
}

}  // namespace evpose
