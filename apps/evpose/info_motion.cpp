// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <numbers>

#include "evpose/io/motion/imu_axes.h"
#include "evpose/io/motion/imu_text.h"
#include "evpose/io/motion/imu_units.h"
#include "evpose/io/recording/imu_survey.h"
#include "info_parts.h"

namespace evpose {
namespace {

constexpr double kGravity = 9.81;
constexpr double kGravityTolerance = 0.3;  // m/s^2: scale and bias of a cheap sensor
constexpr double kLargeBias = 0.1;         // rad/s

std::string vector_text(const Eigen::Vector3d& v, int decimals) {
  return "(" + fixed(v.x(), decimals) + ", " + fixed(v.y(), decimals) + ", " + fixed(v.z(), decimals) + ")";
}

nlohmann::ordered_json vector_json(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

std::string short_number(double value) {
  char out[40];
  std::snprintf(out, sizeof out, "%.2e", value);
  return out;
}

void describe_rest(Sheet& sheet, const std::string& where, const ImuAtRest& rest) {
  sheet.row("at rest", fixed(rest.total_s, 1) + " s, longest " + span_text({rest.begin, rest.end}),
            "at_rest_s", rest.total_s);
  sheet.row("  gravity", fixed(rest.accel.norm(), 3) + " m/s^2", "rest_accel_m_s2", rest.accel.norm());
  sheet.row("  gyro bias", vector_text(rest.gyro_bias, 5) + " rad/s", "gyro_bias_rad_s",
            vector_json(rest.gyro_bias));
  sheet.row("  noise",
            "gyroscope " + short_number(rest.gyro_density) + " rad/s/sqrt(Hz), accelerometer " +
                short_number(rest.accel_density) + " m/s^2/sqrt(Hz)",
            "gyro_density", rest.gyro_density);
  sheet.row("", "", "accel_density", rest.accel_density);
  if (std::abs(rest.accel.norm() - kGravity) > kGravityTolerance)
    sheet.find({where, "at rest the accelerometer shows " + fixed(rest.accel.norm(), 3) + " m/s^2, not 9.81",
                "check its unit (m/s^2) and scale"});
  if (rest.gyro_bias.norm() > kLargeBias)
    sheet.find({where, "at rest the gyroscope shows " + fixed(rest.gyro_bias.norm(), 3) + " rad/s",
                "let the IMU estimate or subtract its bias, or start the tracker at rest"});
}

/// Directions that gravity shows up in, in words.
std::string up_axis(const Eigen::Vector3d& accel) {
  Eigen::Index axis = 0;
  accel.cwiseAbs().maxCoeff(&axis);
  return std::string(accel[axis] < 0 ? "-" : "") + static_cast<char>('x' + axis);
}

}  // namespace

Span describe_imu(Sheet& sheet, const std::string& where, const std::vector<ImuSample>& samples) {
  const ImuSummary s = survey_imu(samples);
  sheet.section("IMU: " + where, "imu");
  sheet.row("count", text(s.count), "count", s.count);
  const Span span{s.first, s.last};
  sheet.row("time", span_text(span), "first_ns", s.first);
  sheet.row("", "", "last_ns", s.last);
  sheet.row("", "", "duration_s", s.duration_s());
  sheet.row("rate", fixed(s.rate_hz(), 2) + " Hz, intervals vary by " + fixed(1e6 * s.jitter_s, 1) + " us",
            "rate_hz", s.rate_hz());
  nlohmann::ordered_json gaps = nlohmann::ordered_json::array();
  for (const ImuGap& gap : s.gaps) gaps.push_back({to_seconds(gap.begin), to_seconds(gap.end)});
  sheet.row("gaps",
            s.gaps.empty() ? "none"
                           : text(s.gap_count, ", the longest ",
                                  fixed(1e3 * to_seconds(s.gaps[0].end - s.gaps[0].begin), 1), " ms"),
            "gaps_s", gaps);
  sheet.row("", "", "gap_count", s.gap_count);
  if (s.gap_count > 0)
    sheet.find({where,
                text(s.gap_count, " gaps of more than 2.5 intervals, the longest ",
                     fixed(1e3 * to_seconds(s.gaps[0].end - s.gaps[0].begin), 1), " ms at ",
                     fixed(to_seconds(s.gaps[0].begin), 3), " s"),
                "record with less load; gaps of more than 100 ms are refused when tracking"});
  if (s.not_forward > 0)
    sheet.find({where, text(s.not_forward, " stamps repeat or go back"),
                "sort the samples and remove repeated ones"});
  sheet.row("mean",
            vector_text(s.mean_gyro, 4) + " rad/s, " + vector_text(s.mean_accel, 3) + " m/s^2, |a| " +
                fixed(s.mean_accel_norm, 3),
            "mean_gyro_rad_s", vector_json(s.mean_gyro));
  sheet.row("", "", "mean_accel_m_s2", vector_json(s.mean_accel));
  sheet.row("", "", "mean_accel_norm_m_s2", s.mean_accel_norm);
  sheet.row("largest", fixed(s.largest_gyro, 2) + " rad/s, " + fixed(s.largest_accel, 1) + " m/s^2",
            "largest_gyro_rad_s", s.largest_gyro);
  sheet.row("", "", "largest_accel_m_s2", s.largest_accel);
  sheet.row("up", up_axis(s.at_rest ? s.at_rest->accel : s.mean_accel) + " axis", "up",
            up_axis(s.at_rest ? s.at_rest->accel : s.mean_accel));
  ImuUnitCheck units;
  for (const ImuSample& sample : samples) units.add(sample);
  if (auto status = units.check_accel(where); !status) sheet.find(status.error());
  if (auto status = units.check_gyro(where); !status)
    sheet.find(status.error());
  else if (const auto doubt = doubt_gyro_by_gravity(samples, where))
    sheet.find(*doubt);
  if (const auto doubt = doubt_imu_scales(samples, where)) sheet.find(*doubt);
  if (s.at_rest)
    describe_rest(sheet, where, *s.at_rest);
  else
    sheet.row("at rest", "never: no bias or noise to be told", "at_rest_s", 0);
  return span;
}

Expected<Span> describe_imu_file(Sheet& sheet, const std::string& path) {
  auto options = recognise_imu_text(path);
  if (!options) {
    // Ours says its columns; that its values are strange is for the findings.
    if (const auto ours = ImuReader::open(path); !ours) return options.error();
    options = ImuReadOptions{};
  }
  options->max_gap_s = options->warn_gap_s = 1e9;  // told below
  auto reader = ImuReader::open(path, *options);
  if (!reader) return reader.error();
  std::vector<ImuSample> samples;
  ImuSample sample;
  while (true) {
    const auto more = reader->next(sample);
    if (!more) sheet.find(more.error());
    if (!more || !*more) break;
    samples.push_back(sample);
  }
  if (samples.empty()) return Error{path, "holds no IMU samples that can be read", "record again"};
  return describe_imu(sheet, path, samples);
}

Span describe_trajectory(Sheet& sheet, const std::string& where, const std::vector<TimedPose>& poses,
                         const std::string& title) {
  const Span span{poses.front().t, poses.back().t};
  double length_m = 0, largest_m_s = 0, turned_rad = 0;
  Eigen::Vector3d low = poses.front().pose.p, high = low;
  TimeNs longest = 0, longest_at = 0;
  for (std::size_t i = 1; i < poses.size(); ++i) {
    const TimeNs step = poses[i].t - poses[i - 1].t;
    const double metres = (poses[i].pose.p - poses[i - 1].pose.p).norm();
    length_m += metres;
    turned_rad += poses[i].pose.q.angularDistance(poses[i - 1].pose.q);
    low = low.cwiseMin(poses[i].pose.p), high = high.cwiseMax(poses[i].pose.p);
    if (step > longest) longest = step, longest_at = poses[i - 1].t;
    if (step <= 0) continue;
    largest_m_s = std::max(largest_m_s, metres / to_seconds(step));
  }
  const double duration_s = to_seconds(span.last - span.first);
  const double step_s = poses.size() < 2 ? 0 : duration_s / static_cast<double>(poses.size() - 1);
  sheet.section(title + ": " + where, title);
  sheet.row("poses", text(poses.size()), "count", poses.size());
  sheet.row("time", span_text(span), "first_ns", span.first);
  sheet.row("", "", "last_ns", span.last);
  sheet.row("", "", "duration_s", duration_s);
  if (step_s > 0)
    sheet.row("rate",
              fixed(1 / step_s, 1) + " Hz, longest gap " + fixed(1e3 * to_seconds(longest), 1) + " ms",
              "rate_hz", 1 / step_s);
  sheet.row("", "", "longest_gap_s", to_seconds(longest));
  const double mean = duration_s > 0 ? length_m / duration_s : 0;
  sheet.row("length",
            fixed(length_m, 3) + " m, turned " + fixed(turned_rad * 180 / std::numbers::pi, 1) + " deg",
            "length_m", length_m);
  sheet.row("", "", "turned_deg", turned_rad * 180 / std::numbers::pi);
  sheet.row("speed", fixed(mean, 3) + " m/s mean, " + fixed(largest_m_s, 3) + " m/s largest",
            "mean_speed_m_s", mean);
  sheet.row("", "", "largest_speed_m_s", largest_m_s);
  sheet.row("bounds",
            "x " + fixed(low.x(), 2) + " .. " + fixed(high.x(), 2) + "  y " + fixed(low.y(), 2) + " .. " +
                fixed(high.y(), 2) + "  z " + fixed(low.z(), 2) + " .. " + fixed(high.z(), 2) + " m",
            "bounds_m", {low.x(), low.y(), low.z(), high.x(), high.y(), high.z()});
  if (step_s > 0 && to_seconds(longest) > 10 * step_s)
    sheet.find({where,
                "no poses for " + fixed(to_seconds(longest), 3) + " s after " +
                    fixed(to_seconds(longest_at), 3) + " s",
                "nothing is judged inside such a gap"});
  return span;
}

}  // namespace evpose
