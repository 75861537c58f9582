// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/recording/handed_over.h"

#include <numbers>
#include <utility>

#include "evpose/core/config.h"
#include "evpose/core/error.h"
#include "evpose/io/calibration/calibration.h"
#include "evpose/sim/world/random.h"

namespace evpose::sim {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr std::uint64_t kStream = 1ULL << 43;

HandedOverConfig values_of(CalibrationQuality quality) {
  HandedOverConfig c;
  c.preset = quality;
  if (quality == CalibrationQuality::truth) {
    c.focal_sigma = c.centre_sigma_px = c.k1_sigma = c.k2_sigma = c.p1_sigma = c.p2_sigma = 0;
    c.rotation_sigma_deg = c.translation_sigma_mm = c.time_sigma_ms = 0;
  } else {
    c.focal_sigma = 0.003, c.centre_sigma_px = 1;
    c.k1_sigma = 0.01, c.k2_sigma = 0.02, c.p1_sigma = c.p2_sigma = 0.0005;
    c.rotation_sigma_deg = 0.3, c.translation_sigma_mm = 10, c.time_sigma_ms = 2;
  }
  return c;
}

}  // namespace

void describe(ConfigTable& table, HandedOverConfig& c) {
  table.add("preset", c.preset,
            ConfigTable::Choices<CalibrationQuality>{{"truth", CalibrationQuality::truth},
                                                     {"ordinary", CalibrationQuality::ordinary}},
            "errors of the calibration that the recording comes with; -1 below selects its value");
  table.add("focal_sigma", c.focal_sigma, "", "of both focal lengths together, relative, 1 sigma", {-1, 0.2});
  table.add("centre_sigma_px", c.centre_sigma_px, "px", "principal point, each coordinate, 1 sigma",
            {-1, 100});
  table.add("k1_sigma", c.k1_sigma, "", "radial distortion, 1 sigma", {-1, 0.5});
  table.add("k2_sigma", c.k2_sigma, "", "radial distortion, 1 sigma", {-1, 0.5});
  table.add("p1_sigma", c.p1_sigma, "", "tangential distortion, 1 sigma", {-1, 0.05});
  table.add("p2_sigma", c.p2_sigma, "", "tangential distortion, 1 sigma", {-1, 0.05});
  table.add("rotation_sigma_deg", c.rotation_sigma_deg, "deg", "between camera and IMU, each axis, 1 sigma",
            {-1, 45});
  table.add("translation_sigma_mm", c.translation_sigma_mm, "mm",
            "of the camera from the IMU, each axis, 1 sigma", {-1, 1000});
  table.add("time_sigma_ms", c.time_sigma_ms, "ms", "between camera and IMU, 1 sigma", {-1, 1000});
}

HandedOverConfig with_preset_values(const HandedOverConfig& config) {
  const HandedOverConfig own = values_of(config.preset);
  HandedOverConfig out = config;
  for (const auto member :
       {&HandedOverConfig::focal_sigma, &HandedOverConfig::centre_sigma_px, &HandedOverConfig::k1_sigma,
        &HandedOverConfig::k2_sigma, &HandedOverConfig::p1_sigma, &HandedOverConfig::p2_sigma,
        &HandedOverConfig::rotation_sigma_deg, &HandedOverConfig::translation_sigma_mm,
        &HandedOverConfig::time_sigma_ms})
    if (out.*member < 0) out.*member = own.*member;
  return out;
}

bool CalibrationErrors::none() const {
  double sum = std::abs(focal) + std::abs(time_s) + rotation_rad.norm() + translation_m.norm();
  for (const double e : centre_px) sum += std::abs(e);
  for (const double e : distortion) sum += std::abs(e);
  return sum == 0;
}

CalibrationErrors draw_calibration_errors(const HandedOverConfig& config, std::uint64_t seed) {
  const HandedOverConfig c = with_preset_values(config);
  Random random(seed, kStream);
  const auto vector = [&](double sigma) {
    const double x = random.normal(), y = random.normal(), z = random.normal();
    return Eigen::Vector3d(sigma * x, sigma * y, sigma * z);
  };
  CalibrationErrors e;
  e.focal = c.focal_sigma * random.normal();
  for (double& px : e.centre_px) px = c.centre_sigma_px * random.normal();
  const double sigmas[] = {c.k1_sigma, c.k2_sigma, c.p1_sigma, c.p2_sigma};
  for (std::size_t i = 0; i < 4; ++i) e.distortion[i] = sigmas[i] * random.normal();
  e.rotation_rad = vector(kDegree * c.rotation_sigma_deg);
  e.translation_m = vector(1e-3 * c.translation_sigma_mm);
  e.time_s = 1e-3 * c.time_sigma_ms * random.normal();
  return e;
}

CalibrationSigma stated_sigma(const HandedOverConfig& config, const CameraIntrinsics& camera) {
  const HandedOverConfig c = with_preset_values(config);
  CalibrationSigma sigma = CalibrationSigma::known(camera);
  sigma.intrinsics = {c.focal_sigma * camera.fx, c.focal_sigma * camera.fy, c.centre_sigma_px,
                      c.centre_sigma_px};
  if (camera.distortion.size() == 4) sigma.distortion = {c.k1_sigma, c.k2_sigma, c.p1_sigma, c.p2_sigma};
  sigma.rotation_rad = Eigen::Vector3d::Constant(kDegree * c.rotation_sigma_deg);
  sigma.translation_m = Eigen::Vector3d::Constant(1e-3 * c.translation_sigma_mm);
  sigma.time_s = 1e-3 * c.time_sigma_ms;
  return sigma;
}

CalibratedCamera with_errors(const CalibratedCamera& truth, const CalibrationErrors& errors) {
  EVPOSE_CHECK(truth.intrinsics && truth.T_cam_imu && truth.intrinsics->distortion.size() == 4);
  CalibratedCamera camera = truth;
  CameraIntrinsics& i = *camera.intrinsics;
  i.fx *= 1 + errors.focal;
  i.fy *= 1 + errors.focal;
  i.cx += errors.centre_px[0];
  i.cy += errors.centre_px[1];
  for (std::size_t k = 0; k < 4; ++k) i.distortion[k] += errors.distortion[k];
  Pose T_imu_cam = truth.T_cam_imu->inverse();
  T_imu_cam.q = T_imu_cam.q * so3::exp(errors.rotation_rad);
  T_imu_cam.p += errors.translation_m;
  camera.T_cam_imu = T_imu_cam.inverse();
  camera.timeshift_cam_imu_s += errors.time_s;
  return camera;
}

std::string to_yaml(const CalibrationErrors& e) {
  const auto list = [](const auto& values, double unit) {
    std::string out = "[";
    for (int i = 0; i < static_cast<int>(values.size()); ++i) {
      out += text(i == 0 ? "" : ", ", values[static_cast<std::size_t>(i)] / unit);
    }
    return out + "]";
  };
  const std::array<double, 3> turn{e.rotation_rad.x(), e.rotation_rad.y(), e.rotation_rad.z()};
  const std::array<double, 3> shift{e.translation_m.x(), e.translation_m.y(), e.translation_m.z()};
  return text("# Errors of camchain-imucam.yaml; camchain-imucam_truth.yaml has none.\nfocal: ", e.focal,
              "\ncentre_px: ", list(e.centre_px, 1), "\ndistortion: ", list(e.distortion, 1),
              "\nrotation_deg: ", list(turn, kDegree), "\ntranslation_mm: ", list(shift, 1e-3),
              "\ntime_ms: ", 1e3 * e.time_s, "\n");
}

}  // namespace evpose::sim
