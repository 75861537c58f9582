// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/motion/imu_axes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace evpose {
namespace {

constexpr double kGravity = 9.81;
constexpr double kDegreesPerRadian = 180 / std::numbers::pi;
constexpr double kLookedAt_s = 30;                              // of the samples
constexpr double kLeast_s = 1;                                  // shorter recordings tell nothing
constexpr double kLeastInterval_s = 5e-3;                       // samples that come faster are taken together
constexpr double kLeastForce_m_s2 = 6.5, kMostForce_m_s2 = 15;  // mean size over any flight
constexpr double kLeastRate_hz = 2, kMostRate_hz = 5e4;
// By gravity: drift of the gyroscope and speed of the flight bound the lengths.
constexpr double kChunk_s = 6;              // turned by one integral
constexpr double kForceWindow_s = 0.5;      // one mean of the specific force
constexpr double kWhirl_m_s2 = 4;           // spread of these means that hardly a flight has
constexpr double kExplainedShare = 0.55;    // of the spread, left by other axes: then they are the right ones
constexpr double kFastInDegrees_rad_s = 3;  // root mean square of rates that may be degrees
constexpr double kDegreesShare = 1.0 / 3;   // of the spread, left by the other unit
constexpr double kSteepSine = 0.8;  // of the way that the camera looks up or down: no roll is told then
constexpr double kLyingDeg = 50;    // roll that hardly a flight has in the mean
// Against a reference.
constexpr double kTurnWindow_s = 0.1;
constexpr double kLeastTurn_rad = 0.004;  // root mean square turn over a window
constexpr double kWrongShare = 0.1;       // of the turns, unexplained as read: beyond bias and noise,
constexpr double kRightShare = 0.35;      // and with other axes,
constexpr double kRighter = 0.4;          // which must leave so little of what was unexplained
constexpr double kWrongForce_m_s2 = 4, kRightForce_m_s2 = 2;

std::vector<AxisNames> all_axis_names() {
  std::vector<AxisNames> out;
  std::array<int, 3> order{0, 1, 2};
  do {
    for (int signs = 0; signs < 8; ++signs) {
      AxisNames names = AxisNames::Zero();
      for (int i = 0; i < 3; ++i)
        names(i, order[static_cast<std::size_t>(i)]) = (signs >> i & 1) != 0 ? -1 : 1;
      out.push_back(names);
    }
  } while (std::next_permutation(order.begin(), order.end()));
  return out;
}

/// The first seconds, samples that come fast averaged.
std::vector<ImuSample> first_part(const std::vector<ImuSample>& samples) {
  std::vector<ImuSample> out;
  ImuSample sum;
  int count = 0;
  for (const ImuSample& s : samples) {
    if (to_seconds(s.t - samples.front().t) > kLookedAt_s) break;
    if (count == 0) sum.t = s.t;
    sum.gyro += s.gyro, sum.accel += s.accel, ++count;
    if (to_seconds(s.t - sum.t) < kLeastInterval_s && count > 0 && &s != &samples.back()) continue;
    sum.t = sum.t + (s.t - sum.t) / 2;
    sum.gyro /= count, sum.accel /= count;
    if (out.empty() || sum.t > out.back().t) out.push_back(sum);
    sum = {}, count = 0;
  }
  return out;
}

/// Root mean square of what the means of the specific force, turned by the gyroscope, spread about their own
/// mean; m/s^2.
double force_spread(const std::vector<ImuSample>& samples, const Eigen::Matrix3d& of_gyro) {
  double square = 0;
  int count = 0;
  for (std::size_t i = 0; i + 1 < samples.size();) {
    const TimeNs begin = samples[i].t;
    Eigen::Quaterniond turned = Eigen::Quaterniond::Identity();
    std::vector<Eigen::Vector3d> means;
    while (i + 1 < samples.size() && to_seconds(samples[i].t - begin) < kChunk_s) {
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      const TimeNs window = samples[i].t;
      double dt_s = 0;
      for (; i + 1 < samples.size() && to_seconds(samples[i].t - window) < kForceWindow_s; ++i) {
        const double dt = to_seconds(samples[i + 1].t - samples[i].t);
        sum += dt * (turned * samples[i].accel), dt_s += dt;
        turned = turned * so3::exp(0.5 * dt * (of_gyro * (samples[i].gyro + samples[i + 1].gyro)));
      }
      if (dt_s > 0.9 * kForceWindow_s) means.emplace_back(sum / dt_s);
    }
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (const auto& m : means) mean += m / static_cast<double>(means.size());
    for (const auto& m : means) square += (m - mean).squaredNorm();
    count += std::max(0, static_cast<int>(means.size()) - 1);
  }
  return count == 0 ? 0 : std::sqrt(square / count);
}

double gyro_rms(const std::vector<ImuSample>& samples) {
  double square = 0;
  for (const ImuSample& s : samples) square += s.gyro.squaredNorm();
  return std::sqrt(square / static_cast<double>(samples.size()));
}

/// Over one window of the reference: its turn and its mean specific force, and those of the IMU.
struct Window {
  Eigen::Vector3d turn, imu_turn;    ///< rad
  Eigen::Vector3d force, imu_force;  ///< body, m/s^2
};

std::vector<Window> windows_of(const std::vector<TimedPose>& reference,
                               const std::vector<ImuSample>& samples) {
  std::vector<Window> out;
  const auto after = [&](TimeNs t) {
    return std::lower_bound(reference.begin(), reference.end(), t,
                            [](const TimedPose& p, TimeNs time) { return p.t < time; });
  };
  const TimeNs step = from_seconds(kTurnWindow_s);
  const auto velocity = [](const TimedPose& a, const TimedPose& b) {
    return Eigen::Vector3d((b.pose.p - a.pose.p) / to_seconds(b.t - a.t));
  };
  std::size_t i = 0;
  for (TimeNs from = samples.front().t + step;; from += step) {
    const auto before = after(from - step), a = after(from), b = after(from + step),
               last = after(from + 2 * step);
    if (last == reference.end() || last->t > samples.back().t) break;
    const double span_s = to_seconds(b->t - a->t);
    if (before->t >= a->t || span_s <= 0 || span_s > 2 * kTurnWindow_s || last->t <= b->t) continue;
    while (i < samples.size() && samples[i].t < a->t) ++i;
    Window w{so3::log(a->pose.q.conjugate() * b->pose.q), {0, 0, 0}, {0, 0, 0}, {0, 0, 0}};
    double covered_s = 0;
    for (; i + 1 < samples.size() && samples[i].t < b->t; ++i) {
      const double dt = to_seconds(samples[i + 1].t - samples[i].t);
      w.imu_turn += dt * samples[i].gyro, w.imu_force += dt * samples[i].accel, covered_s += dt;
    }
    if (std::abs(covered_s - span_s) > 0.2 * span_s) continue;
    w.imu_force /= covered_s;
    // Centred differences over the windows to both sides: the mean acceleration of about three windows.
    const Eigen::Vector3d accel =
        (velocity(*b, *last) - velocity(*before, *a)) / (0.5 * to_seconds(last->t + b->t - a->t - before->t));
    w.force = a->pose.q.slerp(0.5, b->pose.q).conjugate() * (accel + Eigen::Vector3d(0, 0, kGravity));
    out.push_back(w);
  }
  return out;
}

}  // namespace

AxisChoice choose_axes(const std::function<double(const AxisNames&)>& cost) {
  AxisChoice out;
  out.cost = out.as_read = cost(out.names);
  std::vector<std::pair<double, AxisNames>> tried;
  for (const AxisNames& names : all_axis_names()) tried.emplace_back(cost(names), names);
  const double least = std::min_element(tried.begin(), tried.end(), [](const auto& a, const auto& b) {
                         return a.first < b.first;
                       })->first;
  double kept = -4;
  for (const auto& [value, names] : tried)
    if (value <= 1.1 * least + 1e-9 && names.trace() > kept)
      out.cost = value, out.names = names, kept = names.trace();
  return out;
}

Error wrong_axes(const std::string& where, const std::string& sensor, const std::string& by,
                 const AxisNames& names) {
  return {where, text("the ", sensor, "'s axes do not fit ", by, ": they would if ", in_words(names)),
          "rename the columns (imu.columns in recording.yaml), or correct the signs in the driver"};
}

std::string in_words(const AxisNames& names) {
  std::string out;
  for (int i = 0; i < 3; ++i) {
    Eigen::Index at = 0;
    names.row(i).cwiseAbs().maxCoeff(&at);
    out += text(i == 0 ? "" : ", ", static_cast<char>('x' + i), " were ", names(i, at) < 0 ? "-" : "",
                static_cast<char>('x' + at));
  }
  return out;
}

std::optional<Error> doubt_gyro_by_gravity(const std::vector<ImuSample>& samples, const std::string& where) {
  const std::vector<ImuSample> part = samples.empty() ? samples : first_part(samples);
  if (part.size() < 10 || to_seconds(part.back().t - part.front().t) < kLeast_s) return {};
  const double as_read = force_spread(part, AxisNames::Identity());
  if (as_read < kWhirl_m_s2) return {};
  const double rms = gyro_rms(part);
  if (rms > kFastInDegrees_rad_s &&
      force_spread(part, AxisNames::Identity() / kDegreesPerRadian) < kDegreesShare * as_read)
    return Error{
        where,
        text("turned by the gyroscope, gravity whirls about; it would not if the gyroscope's unit, root "
             "mean square ",
             rms, ", were deg/s, not rad/s"),
        "set imu.gyro_unit: deg/s in recording.yaml"};
  const AxisChoice choice = choose_axes([&](const AxisNames& names) { return force_spread(part, names); });
  if (choice.cost > kExplainedShare * as_read) return {};
  return wrong_axes(where, "gyroscope", "the accelerometer's gravity", choice.names);
}

std::optional<Error> doubt_camera_roll(const std::vector<ImuSample>& samples,
                                       const Eigen::Matrix3d& R_cam_imu, const std::string& where) {
  Eigen::Vector3d force = Eigen::Vector3d::Zero();
  for (const ImuSample& s : samples) {
    if (to_seconds(s.t - samples.front().t) > kLookedAt_s) break;
    force += s.accel;
  }
  if (samples.size() < 10 || force.norm() == 0) return {};
  const Eigen::Vector3d up = (R_cam_imu * force).normalized();
  if (std::abs(up.z()) > kSteepSine) return {};
  const double roll_deg = kDegreesPerRadian * std::atan2(up.x(), -up.y());
  if (std::abs(roll_deg) < kLyingDeg) return {};
  return Error{where,
               text("by gravity the camera is rolled by ", std::round(std::abs(roll_deg)),
                    " deg: if it is not, axes of the IMU are swapped or mirrored, or T_cam_imu is wrong"),
               "rename the columns (imu.columns in recording.yaml), or calibrate camera and IMU together"};
}

std::optional<Error> doubt_imu_scales(const std::vector<ImuSample>& samples, const std::string& where) {
  if (samples.size() < 10) return {};
  double force = 0;
  for (const ImuSample& s : samples) force += s.accel.norm() / static_cast<double>(samples.size());
  const double duration_s = to_seconds(samples.back().t - samples.front().t);
  const double rate_hz = static_cast<double>(samples.size() - 1) / std::max(duration_s, 1e-9);
  if (rate_hz > kMostRate_hz || rate_hz < kLeastRate_hz)
    return Error{where, text("the stamps make ", rate_hz, " samples a second: are they in another unit?"),
                 "set imu.time_unit in recording.yaml: ns, us or s"};
  // Below 2 m/s^2 it is ImuUnitCheck that tells.
  if (force >= kMostForce_m_s2 || (force >= 2 && force <= kLeastForce_m_s2))
    return Error{where,
                 text("mean |acceleration| is ", force, " m/s^2, not about 9.8: is it in another unit?"),
                 "store m/s^2, or g with imu.accel_unit: g in recording.yaml"};
  return {};
}

std::vector<Error> doubt_axes_against(const std::vector<TimedPose>& reference,
                                      const std::vector<ImuSample>& samples, const std::string& where) {
  std::vector<Error> out;
  if (reference.size() < 2 || samples.size() < 10) return out;
  const std::vector<Window> windows = windows_of(reference, first_part(samples));
  if (windows.size() < 2) return out;
  const auto rms = [&](const auto& of_window) {
    double square = 0;
    for (const Window& w : windows) square += of_window(w).squaredNorm();
    return std::sqrt(square / static_cast<double>(windows.size()));
  };
  const double turns = rms([](const Window& w) { return w.turn; });
  const AxisChoice gyro = choose_axes([&](const AxisNames& names) {
    return rms([&](const Window& w) { return Eigen::Vector3d(names * w.imu_turn - w.turn); });
  });
  if (turns > kLeastTurn_rad && gyro.as_read > kWrongShare * turns &&
      gyro.cost < std::min(kRightShare * turns, kRighter * gyro.as_read))
    out.push_back(wrong_axes(where, "gyroscope", "the turns of the ground truth", gyro.names));
  const AxisChoice accel = choose_axes([&](const AxisNames& names) {
    return rms([&](const Window& w) { return Eigen::Vector3d(names * w.imu_force - w.force); });
  });
  if (accel.as_read > kWrongForce_m_s2 && accel.cost < kRightForce_m_s2)
    out.push_back(wrong_axes(where, "accelerometer", "the ground truth's up and accelerations", accel.names));
  return out;
}

}  // namespace evpose
