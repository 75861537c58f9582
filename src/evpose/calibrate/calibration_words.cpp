// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/calibrate/calibration_words.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

namespace evpose {
namespace {

constexpr double kNotTold = 0.7;     // of the given sigma: the recording has added next to nothing
constexpr double kTogether = 0.9;    // correlation of two numbers that hardly anything tells apart
constexpr double kGrows_px = 0.05;   // of a mean offset outwards: more than events and map explain
constexpr double kLittleSeen = 0.5;  // share of the image
constexpr double kDegree = M_PI / 180;

std::vector<std::string> names_of(const CameraIntrinsics& camera) {
  std::vector<std::string> out{"fx", "fy", "cx", "cy"};
  const std::array<const char*, 5> radtan{"k1", "k2", "p1", "p2", "k3"};
  for (std::size_t i = 0; i < camera.distortion.size(); ++i)
    out.push_back(camera.distortion_model == "radtan" ? radtan.at(i)
                  : camera.distortion_model == "ds"   ? (i == 0 ? "xi" : "alpha")
                                                      : text("k", i + 1));
  return out;
}

std::vector<double> values_of(const CameraIntrinsics& c) {
  std::vector<double> out{c.fx, c.fy, c.cx, c.cy};
  out.insert(out.end(), c.distortion.begin(), c.distortion.end());
  return out;
}

std::vector<double> sigmas_of(const CalibrationSigma& sigma) {
  std::vector<double> out = *sigma.intrinsics;
  out.insert(out.end(), sigma.distortion->begin(), sigma.distortion->end());
  return out;
}

void add_mounting(const CalibratedCamera& given, const CalibratedCamera& found,
                  std::vector<CalibrationNumber>& out) {
  const Pose from = given.T_cam_imu->inverse(), to = found.T_cam_imu->inverse();
  const Eigen::Vector3d turn = so3::log(to.q * from.q.conjugate()) / kDegree;
  const std::array<const char*, 3> axes{"x", "y", "z"};
  for (int i = 0; i < 3; ++i)
    out.push_back({text("turn ", axes.at(static_cast<std::size_t>(i))), "deg", 0,
                   (*given.sigma.rotation_rad)(i) / kDegree, turn(i),
                   (*found.sigma.rotation_rad)(i) / kDegree});
  for (int i = 0; i < 3; ++i)
    out.push_back({text("place ", axes.at(static_cast<std::size_t>(i))), "mm", 1e3 * from.p(i),
                   1e3 * (*given.sigma.translation_m)(i), 1e3 * to.p(i),
                   1e3 * (*found.sigma.translation_m)(i)});
  out.push_back({"time", "ms", 1e3 * given.timeshift_cam_imu_s, 1e3 * *given.sigma.time_s,
                 1e3 * found.timeshift_cam_imu_s, 1e3 * *found.sigma.time_s});
}

bool is_told(const CalibrationNumber& n) {
  return !(n.given_sigma > 0) || n.sigma < kNotTold * n.given_sigma;
}

std::string two_digits(double value) {
  char out[32];
  std::snprintf(out, sizeof out, "%.2g", value);
  return out;
}

/// Which motion would tell a number.
std::string remedy_of(const std::string& name, const FlightMotion& motion) {
  if (name == "fx" || name == "fy") return "move towards contours and away, or tilt the camera against them";
  if (name == "cx" || name == "cy")
    return "turn the camera about its optical axis, and see contours at different depths";
  if (name.starts_with("turn")) return "turn about two axes";
  if (name == "time") return "turn to and fro";
  if (!name.starts_with("place")) return "bring contours to the rim of the image on all sides";
  Eigen::Index most = 0;
  motion.rate_deg_s.maxCoeff(&most);
  const std::array<const char*, 3> axes{"x", "y", "z"};
  return text("turn faster, and not about the body's ", axes.at(static_cast<std::size_t>(most)),
              " axis alone");
}

/// One sentence for all elements of a sensor's axes that are not told.
void add_untold_axes(const CalibrationPage& page, const char* sensor, const char* remedy,
                     std::vector<std::string>& out) {
  std::string names;
  for (const CalibrationNumber& n : page.imu_axes)
    if (n.name.starts_with(sensor) && !is_told(n)) names += (names.empty() ? "" : ", ") + n.name;
  if (!names.empty()) out.push_back(text("the motion does not tell ", names, " (IMU's axes); ", remedy));
}

void add_untold(const CalibrationPage& page, std::vector<std::string>& out) {
  add_untold_axes(page, "gyro", "turn fast about all three axes, to and fro", out);
  add_untold_axes(page, "accel", "bring each axis to the vertical, both ways up, or accelerate hard along it",
                  out);
  for (const CalibrationNumber& n : page.numbers)
    if (!is_told(n))
      out.push_back(text("the motion does not tell ", n.name, ": it is known to ", two_digits(n.sigma),
                         n.unit.empty() ? "" : " ", n.unit, ", before to ", two_digits(n.given_sigma), "; ",
                         remedy_of(n.name, page.flights.front())));
}

void add_correlations(const CalibrationPage& page, std::vector<std::string>& out) {
  const Eigen::MatrixXd& R = page.correlation;
  for (Eigen::Index i = 0; i < R.rows(); ++i)
    for (Eigen::Index j = i + 1; j < R.cols(); ++j) {
      if (!(std::abs(R(i, j)) > kTogether)) continue;
      const std::string &a = page.numbers[static_cast<std::size_t>(i)].name,
                        &b = page.numbers[static_cast<std::size_t>(j)].name;
      out.push_back(text(a, " and ", b, " are known together better than alone (correlation ",
                         std::round(100 * R(i, j)) / 100, "): use both from this file, or none"));
    }
}

void add_residuals(const CalibrationPage& page, std::vector<std::string>& out) {
  if (page.radius.size() < 2) return;
  const auto worst =
      std::ranges::max_element(page.radius, {}, [](const RadiusBin& b) { return std::abs(b.outward_px); });
  if (std::abs(worst->outward_px) > kGrows_px)
    out.push_back(text("contours ", std::lround(worst->radius_px), " px from the middle lie ",
                       std::round(100 * std::abs(worst->outward_px)) / 100, " px too far ",
                       worst->outward_px < 0 ? "out" : "in",
                       " in the mean: the distortion model may be too simple, or the map wrong there"));
}

void add_view(const CalibrationPage& page, std::vector<std::string>& out) {
  double most = 0;
  for (const FlightMotion& f : page.flights) most = std::max(most, f.coverage);
  if (most < kLittleSeen)
    out.push_back(text("contours were seen in ", std::lround(100 * most),
                       " % of the image: beyond, the distortion is extrapolated"));
}

}  // namespace

std::vector<CalibrationNumber> numbers_of(const RunCalibration& calibration) {
  const auto& [given, found] = calibration;
  std::vector<CalibrationNumber> out;
  const std::vector<std::string> names = names_of(*found.intrinsics);
  const std::vector<double> from = values_of(*given.intrinsics), to = values_of(*found.intrinsics),
                            from_sigma = sigmas_of(given.sigma), to_sigma = sigmas_of(found.sigma);
  for (std::size_t i = 0; i < names.size(); ++i)
    out.push_back({names[i], i < 4 ? "px" : "", from[i], from_sigma[i], to[i], to_sigma[i]});
  if (found.T_cam_imu) add_mounting(given, found, out);
  return out;
}

std::vector<CalibrationNumber> axes_numbers(const ImuAxes& given, const ImuAxes& found, double sigma) {
  constexpr double kPercent = 100;
  std::vector<CalibrationNumber> out;
  const std::array<char, 3> axes{'x', 'y', 'z'};
  const auto add = [&](const char* sensor, const Eigen::Matrix3d& from, const Eigen::Matrix3d& from_sigma,
                       const Eigen::Matrix3d& to, const Eigen::Matrix3d& to_sigma) {
    for (int row = 0; row < 3; ++row)
      for (int column = 0; column < 3; ++column) {
        const double ideal = row == column ? 1 : 0;
        const double before = from_sigma.minCoeff() < 0 ? sigma : from_sigma(row, column);
        out.push_back({text(sensor, " ", axes.at(static_cast<std::size_t>(row)),
                            axes.at(static_cast<std::size_t>(column))),
                       "%", kPercent * (from(row, column) - ideal), kPercent * before,
                       kPercent * (to(row, column) - ideal), kPercent * to_sigma(row, column)});
      }
  };
  add("gyro", given.gyro, given.gyro_sigma, found.gyro, found.gyro_sigma);
  add("accel", given.accel, given.accel_sigma, found.accel, found.accel_sigma);
  return out;
}

std::vector<std::string> calibration_words(const CalibrationPage& page) {
  std::vector<std::string> out;
  add_untold(page, out);
  add_view(page, out);
  add_residuals(page, out);
  add_correlations(page, out);
  return out;
}

}  // namespace evpose
