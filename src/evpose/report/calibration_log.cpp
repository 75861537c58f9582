// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/report/calibration_log.h"

#include <algorithm>
#include <cinttypes>
#include <cstdio>

#include "evpose/core/error.h"

namespace evpose {
namespace {

constexpr std::size_t kFixed = 9, kPinhole = 4;

void append(std::vector<double>& list, const auto& vector) {
  for (Eigen::Index i = 0; i < vector.size(); ++i) list.push_back(vector(i));
}

}  // namespace

std::vector<std::string> calibration_columns(std::size_t intrinsics) {
  std::vector<std::string> out{
      "time_offset_s", "turn_x_rad",         "turn_y_rad",         "turn_z_rad", "shift_x_m", "shift_y_m",
      "shift_z_m",     "gravity_tilt_x_rad", "gravity_tilt_y_rad", "fx_px",      "fy_px",     "cx_px",
      "cy_px"};
  for (std::size_t k = kPinhole; k < intrinsics; ++k) out.push_back(text("distortion_", k - kPinhole + 1));
  out.resize(kFixed + intrinsics);
  return out;
}

CalibrationRow calibration_row(TimeNs t, const Calibration& c) {
  CalibrationRow out{t, {c.time_offset_s}, {c.time_sigma_s}};
  append(out.value, so3::log(c.turn));
  append(out.value, c.shift);
  append(out.value, c.gravity_tilt_rad);
  append(out.value, c.intrinsics);
  append(out.sigma, c.turn_sigma_rad);
  append(out.sigma, c.shift_sigma_m);
  append(out.sigma, c.gravity_sigma_rad);
  append(out.sigma, c.intrinsics_sigma);
  out.sigma.resize(out.value.size());
  return out;
}

bool is_estimated(const CalibrationRow& row) {
  return std::any_of(row.sigma.begin(), row.sigma.end(), [](double sigma) { return sigma > 0; });
}

std::string calibration_csv_header(const CalibrationRow& first) {
  const auto names = calibration_columns(first.value.size() - kFixed);
  std::string out = "t_s";
  for (const std::string& name : names) out += "," + name;
  for (const std::string& name : names) out += ",sigma_" + name;
  return out + "\n";
}

std::string calibration_csv_row(const CalibrationRow& row) {
  std::string out = csv_seconds(row.t);
  for (const double v : row.value) append_csv(out, v);
  for (const double v : row.sigma) append_csv(out, v);
  return out + "\n";
}

std::string csv_seconds(TimeNs t) {
  const bool negative = t < 0;
  const std::uint64_t magnitude =
      negative ? 0 - static_cast<std::uint64_t>(t) : static_cast<std::uint64_t>(t);
  char out[40];
  std::snprintf(out, sizeof out, "%s%" PRIu64 ".%09" PRIu64, negative ? "-" : "", magnitude / 1'000'000'000,
                magnitude % 1'000'000'000);
  return out;
}

void append_csv(std::string& row, double value) {
  char out[40];
  std::snprintf(out, sizeof out, ",%.9g", value);
  row += out;
}

}  // namespace evpose
