// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/motion/imu_units.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace evpose {
namespace {

constexpr double kDegreesPerRadian = 180 / std::numbers::pi;
/// 2000 deg/s, where the usual sensors of drones end, in rad/s.
constexpr double kSensorRange = 2000 / kDegreesPerRadian;
/// Two turns a second throughout a recording: no craft that looks where it goes.
constexpr double kFastestOnTheWhole = 4 * std::numbers::pi;
constexpr std::int64_t kFewest = 10;

Error degrees(const std::string& where, const std::string& what) {
  return Error{where, what + ": the gyroscope is in deg/s, not rad/s",
               "set imu.gyro_unit: deg/s in recording.yaml"};
}

}  // namespace

void ImuUnitCheck::add(const ImuSample& sample) {
  ++count_;
  accel_sum_ += sample.accel.norm();
  gyro_square_sum_ += sample.gyro.squaredNorm();
  beyond_range_ += sample.gyro.cwiseAbs().maxCoeff() > kSensorRange ? 1 : 0;
}

Status ImuUnitCheck::check_accel(const std::string& where) const {
  if (count_ < kFewest) return {};
  const double accel = accel_sum_ / static_cast<double>(count_);
  if (accel > 0.6 && accel < 2)
    return Error{where, text("mean |acceleration| is ", accel, ": the accelerometer is in g, not m/s^2"),
                 "set imu.accel_unit: g in recording.yaml"};
  if (accel <= 0.6)
    return Error{where, text("mean |acceleration| is ", accel, " m/s^2: gravity has been removed"),
                 "store the specific force as measured, about 9.81 m/s^2 upwards at rest"};
  return {};
}

Status ImuUnitCheck::check_gyro(const std::string& where) const {
  if (count_ < kFewest) return {};
  const double gyro = std::sqrt(gyro_square_sum_ / static_cast<double>(count_));
  // A single outlier may be a bump; a hundredth of the samples is no bump.
  if (gyro > kFastestOnTheWhole || beyond_range_ * 100 > count_)
    return degrees(where, text("the rates' root mean square is ", gyro));
  return {};
}

Status check_imu_units(const std::vector<ImuSample>& samples, const std::string& where) {
  ImuUnitCheck check;
  for (const ImuSample& s : samples) check.add(s);
  if (auto status = check.check_accel(where); !status) return status;
  return check.check_gyro(where);
}

Status check_gyro_against(const std::vector<TimedPose>& reference, const std::vector<ImuSample>& samples,
                          const std::string& where) {
  if (reference.size() < 2 || samples.size() < 2) return {};
  const auto pose_after = [&](TimeNs t) {
    return std::lower_bound(reference.begin(), reference.end(), t,
                            [](const TimedPose& p, TimeNs time) { return p.t < time; });
  };
  double turned_reference = 0, turned_gyro = 0, turned_degrees = 0;
  const TimeNs step = kNsPerS / 2;
  std::size_t i = 0;
  for (auto a = pose_after(samples.front().t); a != reference.end();) {
    const auto b = pose_after(a->t + step);
    if (b == reference.end() || b->t > samples.back().t) break;
    if (b->t - a->t < 2 * step) {
      while (i < samples.size() && samples[i].t < a->t) ++i;
      Eigen::Quaterniond in_radians = Eigen::Quaterniond::Identity(), in_degrees = in_radians;
      for (; i + 1 < samples.size() && samples[i].t < b->t; ++i) {
        const Eigen::Vector3d turn = samples[i].gyro * to_seconds(samples[i + 1].t - samples[i].t);
        in_radians = in_radians * so3::exp(turn);
        in_degrees = in_degrees * so3::exp(turn / kDegreesPerRadian);
      }
      turned_reference += so3::log(a->pose.q.conjugate() * b->pose.q).norm();
      turned_gyro += so3::log(in_radians).norm();
      turned_degrees += so3::log(in_degrees).norm();
    }
    a = b;
  }
  // Angles over a window wrap, so compare with both readings: the one in degrees must fit and the other not.
  const bool turns = turned_reference > 0.05;
  const bool fits =
      std::abs(turned_gyro - turned_reference) < std::abs(turned_degrees - turned_reference) * 3;
  const bool fits_degrees = std::abs(turned_degrees - turned_reference) < 0.3 * turned_reference;
  if (turns && !fits && fits_degrees)
    return degrees(where,
                   text("the ground truth turns by ", turned_reference * kDegreesPerRadian,
                        " deg in all, the gyroscope read as deg/s by ", turned_degrees * kDegreesPerRadian));
  return {};
}

}  // namespace evpose
