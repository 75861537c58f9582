// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/calibrate/data_sheet.h"

#include <algorithm>
#include <cmath>

namespace evpose {
namespace {

constexpr double kFocal = 0.05, kAspect = 5e-3;  // relative; of the ratio of both focal lengths
constexpr double kCentre = 0.03;                 // of the image's width
constexpr double kRadial = 0.1, kTangential = 2e-3;
// k2 of radial-tangential lenses has the other sign: so much of k1, and so far from that.
constexpr double kSecondOfFirst = -0.35, kSecond = 0.04;
constexpr double kRotation_rad = 2 * M_PI / 180, kTranslation_m = 0.03, kTime_s = 0.01;

// k1 and k2 that show an equidistant lens out to 39 deg from the axis: 1 sigma of all lenses, beside kRadial.
constexpr double kEquidistant[] = {-0.32, 0.12};

std::vector<double> distortion_sigma(const CameraIntrinsics& camera) {
  std::vector<double> out(camera.distortion.size(), kRadial);
  if (camera.distortion_model != "radtan") return out;
  out[1] = std::hypot(kSecondOfFirst * kRadial, kSecond);
  std::fill_n(out.begin() + 2, 2, kTangential);
  return out;
}

bool all_zero(const std::vector<double>& values) {
  return std::ranges::all_of(values, [](double v) { return v == 0; });
}

}  // namespace

CalibrationSigma data_sheet_sigma(const CalibrationSigma& stated, const CameraIntrinsics& camera) {
  CalibrationSigma out = stated;
  const bool tied = !stated.distortion && camera.distortion_model == "radtan";
  if (!out.distortion) out.distortion = distortion_sigma(camera);
  if (!out.intrinsics) {
    out.intrinsics = {kFocal * camera.fx, kFocal * camera.fy, kCentre * camera.size.width,
                      kCentre * camera.size.width};
    const auto n = 4 + static_cast<Eigen::Index>(camera.distortion.size());
    Eigen::MatrixXd R = Eigen::MatrixXd::Identity(n + 7, n + 7);
    // Both focal lengths are one, but for the pixels' aspect: its variance is 2 (1 - r) kFocal^2.
    R(0, 1) = R(1, 0) = 1 - 0.5 * std::pow(kAspect / kFocal, 2);
    if (tied) R(4, 5) = R(5, 4) = kSecondOfFirst * kRadial / (*out.distortion)[1];
    if (!out.correlation) out.correlation = R;
  }
  if (!out.rotation_rad) out.rotation_rad = Eigen::Vector3d::Constant(kRotation_rad);
  if (!out.translation_m) out.translation_m = Eigen::Vector3d::Constant(kTranslation_m);
  if (!out.time_s) out.time_s = kTime_s;
  return out;
}

CalibrationSigma any_lens_sigma(const CalibrationSigma& stated, const CameraIntrinsics& camera) {
  CalibrationSigma out = data_sheet_sigma(stated, camera);
  if (stated.distortion || stated.correlation || camera.distortion_model != "radtan") return out;
  for (int i = 0; i < 2; ++i) (*out.distortion)[i] = std::hypot(kRadial, kEquidistant[i]);
  Eigen::MatrixXd R = out.of_correlation(camera);
  R(4, 5) = R(5, 4) = kEquidistant[0] * kEquidistant[1] / ((*out.distortion)[0] * (*out.distortion)[1]);
  out.correlation = R;
  return out;
}

CalibrationSigma only_data_sheet(const CalibrationSigma& stated, const CameraIntrinsics& camera) {
  CalibrationSigma known;
  if (stated.intrinsics && all_zero(*stated.intrinsics)) known.intrinsics = stated.intrinsics;
  if (stated.distortion && all_zero(*stated.distortion)) known.distortion = stated.distortion;
  if (stated.rotation_rad && stated.rotation_rad->isZero(0)) known.rotation_rad = stated.rotation_rad;
  if (stated.translation_m && stated.translation_m->isZero(0)) known.translation_m = stated.translation_m;
  if (stated.time_s && *stated.time_s == 0) known.time_s = 0;
  return data_sheet_sigma(known, camera);
}

CameraIntrinsics with_distortion(CameraIntrinsics camera) {
  if (camera.distortion_model != "none") return camera;
  camera.distortion_model = "radtan";
  camera.distortion.assign(4, 0);
  return camera;
}

}  // namespace evpose
