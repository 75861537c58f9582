// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>

#include "evpose/report/page_parts.h"

namespace evpose {
namespace {

constexpr double kDegPerRad = 180 / std::numbers::pi;
constexpr std::array kAxes{"x", "y", "z"};
constexpr std::array kAngles{"roll", "pitch", "yaw"};

std::string format(const char* pattern, auto... values) {
  char out[200];
  std::snprintf(out, sizeof out, pattern, values...);
  return out;
}

/// Roll, pitch and yaw, degrees: R = Rz(yaw) Ry(pitch) Rx(roll).
Eigen::Vector3d attitude_deg(const Eigen::Quaterniond& q) {
  const Eigen::Matrix3d R = q.toRotationMatrix();
  return kDegPerRad * Eigen::Vector3d(std::atan2(R(2, 1), R(2, 2)),
                                      std::asin(std::clamp(-R(2, 0), -1.0, 1.0)),
                                      std::atan2(R(1, 0), R(0, 0)));
}

/// Angles over time without jumps of a turn; the first is nearest to `near_deg`.
Series without_jumps(Series angle, double near_deg) {
  double before = near_deg;
  for (double& y : angle.y) {
    y += 360 * std::round((before - y) / 360);
    before = y;
  }
  return angle;
}

PageJson line_json(const char* name, const char* ink, const Series& series) {
  return {{"name", name}, {"ink", ink}, {"series", series_json(series)}};
}

PageJson velocity_json(const StateLog& log, TimeNs origin) {
  PageJson out = PageJson::array();
  for (int axis = 0; axis < 3; ++axis) {
    Series value, low, high;
    for (const StateRow& row : log.rows) {
      if (!row.valid()) continue;
      const double t = to_seconds(row.t - origin);
      const double bound = 3 * static_cast<double>(row.velocity_sigma[axis]);
      value.add(t, row.velocity[axis]);
      low.add(t, row.velocity[axis] - bound);
      high.add(t, row.velocity[axis] + bound);
    }
    PageJson line = line_json(kAxes[axis], kAxes[axis], value);
    line["low"] = series_json(low, kBandPoints);
    line["high"] = series_json(high, kBandPoints);
    out.push_back(line);
  }
  return out;
}

PageJson attitudes_json(const StateLog& log, std::span<const TimedPose> truth, TimeNs origin) {
  std::array<Series, 3> estimated, true_one;
  for (const StateRow& row : log.rows) {
    if (!row.valid()) continue;
    const Eigen::Vector3d angles = attitude_deg(row.T_map_body.q);
    for (int k = 0; k < 3; ++k) estimated[k].add(to_seconds(row.t - origin), angles[k]);
  }
  for (const TimedPose& p : truth) {
    const Eigen::Vector3d angles = attitude_deg(p.pose.q);
    for (int k = 0; k < 3; ++k) true_one[k].add(to_seconds(p.t - origin), angles[k]);
  }
  PageJson out = PageJson::array();
  for (int k = 0; k < 3; ++k) {
    if (estimated[k].y.empty()) continue;
    const double first = estimated[k].y.front();
    PageJson line = line_json(kAngles[k], kAxes[k], without_jumps(estimated[k], first));
    if (!true_one[k].y.empty()) line["truth"] = series_json(without_jumps(true_one[k], first));
    out.push_back(line);
  }
  return out;
}

PageJson bias_json(const StateLog& log, Eigen::Vector3f StateRow::*bias, TimeNs origin) {
  PageJson out = PageJson::array();
  for (int axis = 0; axis < 3; ++axis) {
    Series value;
    for (const StateRow& row : log.rows)
      if (row.valid()) value.add(to_seconds(row.t - origin), 1e3 * static_cast<double>((row.*bias)[axis]));
    out.push_back(line_json(kAxes[axis], kAxes[axis], value));
  }
  return out;
}

std::string label_of(const std::string& key) {
  constexpr std::array<std::array<const char*, 2>, 8> kLabels{
      {{"fx_px", "Focal length x, px"},
       {"fy_px", "Focal length y, px"},
       {"cx_px", "Principal point x, px"},
       {"cy_px", "Principal point y, px"},
       {"distortion", "Distortion"},
       {"camera_turned_deg", "Camera turned, deg, about"},
       {"camera_in_imu_m", "Camera in the IMU's frame, m,"},
       {"timeshift_cam_imu_s", "Time from camera to IMU, s"}}};
  for (const auto& [name, label] : kLabels)
    if (key == name) return label;
  return key;
}

/// A row for each number below `entry`: name, given, its sigma, found, its sigma, change in sigmas of what
/// was given.
void add_rows(const std::string& name, const PageJson& entry, PageJson* rows) {
  if (entry.is_object() && entry.contains("given")) {
    const double given = entry["given"], sigma = entry["given_sigma"], found = entry["found"];
    const std::string change = sigma > 0 ? format("%+.2f", (found - given) / sigma) : "";
    rows->push_back({name, format("%.5g", given), format("%.2g", sigma), format("%.5g", found),
                     format("%.2g", entry["sigma"].get<double>()), change});
    return;
  }
  std::size_t k = 1;
  for (const auto& [key, value] : entry.items())
    add_rows(name + " " + (entry.is_array() ? std::to_string(k++) : key), value, rows);
}

/// Numbers of one unit, in a plot of their own.
struct CalibrationPlot {
  const char *id, *title, *unit;
  double scale;
  std::size_t first, end;  ///< of CalibrationRow
  std::array<const char*, 5> names;
};
constexpr std::array<CalibrationPlot, 6> kCalibrationPlots{{
    {"calibration-time", "Time offset between camera and IMU", "ms", 1e3, 0, 1, {"offset"}},
    {"calibration-turn",
     "Rotation of the camera, about the body's axes",
     "deg",
     kDegPerRad,
     1,
     4,
     {"x", "y", "z"}},
    {"calibration-shift", "Place of the camera in the body", "mm", 1e3, 4, 7, {"x", "y", "z"}},
    {"calibration-gravity", "Tilt of gravity, about the map's axes", "deg", kDegPerRad, 7, 9, {"x", "y"}},
    {"calibration-pinhole", "Focal length and principal point", "px", 1, 9, 13, {"fx", "fy", "cx", "cy"}},
    {"calibration-distortion", "Distortion", "", 1, 13, 18, {"1", "2", "3", "4", "5"}},
}};
constexpr std::array kInks{"x", "y", "z", "warm", "truth"};

PageJson course_json(const StateLog& log, const CalibrationPlot& plot, TimeNs origin) {
  PageJson lines = PageJson::array();
  for (std::size_t k = plot.first; k < std::min(plot.end, log.calibration.back().value.size()); ++k) {
    if (!(log.calibration.front().sigma[k] > 0)) continue;
    Series value, low, high;
    for (const CalibrationRow& row : log.calibration) {
      const double t = to_seconds(row.t - origin);
      value.add(t, plot.scale * row.value[k]);
      low.add(t, plot.scale * (row.value[k] - row.sigma[k]));
      high.add(t, plot.scale * (row.value[k] + row.sigma[k]));
    }
    const std::size_t i = k - plot.first;
    lines.push_back({{"name", plot.names[i]},
                     {"ink", kInks[i]},
                     {"series", series_json(value, kBandPoints)},
                     {"low", series_json(low, kBandPoints)},
                     {"high", series_json(high, kBandPoints)}});
  }
  return {{"id", plot.id}, {"title", plot.title}, {"unit", plot.unit}, {"lines", lines}};
}

}  // namespace

PageJson motion_json(const StateLog& log, std::span<const TimedPose> truth, TimeNs origin) {
  if (std::none_of(log.rows.begin(), log.rows.end(), [](const StateRow& row) { return row.valid(); }))
    return {};
  return {{"velocity", velocity_json(log, origin)}, {"attitude", attitudes_json(log, truth, origin)}};
}

PageJson biases_json(const StateLog& log, TimeNs origin) {
  const bool any = std::any_of(log.rows.begin(), log.rows.end(), [](const StateRow& row) {
    return row.valid() && (!row.gyro_bias.isZero(0) || !row.accel_bias.isZero(0));
  });
  if (!any) return {};
  return {{"gyro", bias_json(log, &StateRow::gyro_bias, origin)},
          {"accel", bias_json(log, &StateRow::accel_bias, origin)}};
}

PageJson start_json(const StateLog& log, const RunSummary& summary) {
  PageJson rows = PageJson::array();
  if (!summary.start.empty()) rows.push_back({"Start", summary.start});
  const auto first =
      std::find_if(log.rows.begin(), log.rows.end(), [](const StateRow& r) { return r.valid(); });
  if (first == log.rows.end()) {
    rows.push_back({"First pose", "none in the whole run"});
    return rows;
  }
  const Eigen::Vector3d p = first->T_map_body.p, a = attitude_deg(first->T_map_body.q);
  const Vector6d sigma = first->covariance_matrix().diagonal().cwiseMax(0).cwiseSqrt();
  const auto after = [&](TimeNs t) { return format("%.3f s", to_seconds(t - log.rows.front().t)); };
  rows.push_back({"First pose", "after " + after(first->t)});
  rows.push_back({"Position", format("%.3f, %.3f, %.3f m; sigma %.3g, %.3g, %.3g mm", p.x(), p.y(), p.z(),
                                     1e3 * sigma[0], 1e3 * sigma[1], 1e3 * sigma[2])});
  rows.push_back({"Roll, pitch, yaw",
                  format("%.2f, %.2f, %.2f deg; sigma %.2g, %.2g, %.2g deg about the body's axes", a.x(),
                         a.y(), a.z(), kDegPerRad * sigma[3], kDegPerRad * sigma[4], kDegPerRad * sigma[5])});
  const auto tracked = std::find_if(log.rows.begin(), log.rows.end(),
                                    [](const StateRow& r) { return r.health == Health::tracking; });
  rows.push_back({"Tracking", tracked == log.rows.end() ? "never" : "after " + after(tracked->t)});
  return rows;
}

PageJson calibration_page_json(const StateLog& log, const RunSummary& summary, TimeNs origin) {
  if (!summary.calibration) return {};
  PageJson table = PageJson::array(), plots = PageJson::array();
  const PageJson numbers = calibration_json(*summary.calibration);
  for (const auto& [key, value] : numbers.items()) add_rows(label_of(key), value, &table);
  if (!log.calibration.empty())
    for (const CalibrationPlot& plot : kCalibrationPlots)
      if (PageJson course = course_json(log, plot, origin); !course["lines"].empty()) plots.push_back(course);
  return {{"table", table}, {"plots", plots}};
}

}  // namespace evpose
