// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numbers>

#include "evpose/io/motion/trajectory.h"
#include "evpose/io/motion/waypoints.h"
#include "evpose/sim/flight/trajectory.h"
#include "evpose/sim/flight/trajectory_curves.h"
#include "evpose/sim/world/random.h"

namespace evpose::sim {
namespace {

using Eigen::Vector3d;
using Kind = TrajectoryKind;

constexpr double kPi = std::numbers::pi;
constexpr double kDegree = kPi / 180;
constexpr double kKnot_s = 0.02;
constexpr double kLongest_s = 14400;
constexpr double kStart_s = 1;  // from rest to speed

/// The defaults of the kind, overridden by what the config sets.
struct MotionLimits {
  double speed_m_s, rate_rad_s, sway_rad, vibration_m, vibration_rad;
};

MotionLimits motion_limits(const TrajectoryConfig& c) {
  struct Defaults {
    double speed_m_s, rate_deg_s, sway_deg, vibration_mm, vibration_deg;
  };
  const Defaults defaults = [&]() -> Defaults {
    switch (c.kind) {
      case Kind::square_spiral:
        return {0.8, 18, 7, 0, 0};
      case Kind::landing:
        return {2.5, 15, 4, 0, 0};
      case Kind::hover:
        return {0.2, 12, 3, 0.1, 0.02};
      case Kind::aggressive:
        return {5, 120, 25, 0, 0};
      case Kind::slow:
        return {0.03, 2, 5, 0, 0};
      case Kind::lissajous:
        return {1.5, 10, 8, 0, 0};
      case Kind::sweep:
        return {1.5, 15, 8, 0, 0};
      case Kind::traverse:
        return {4, 15, 5, 0, 0};
      case Kind::waypoints:
        return {1, 30, 2, 0, 0};
      case Kind::file:
        return {0, 0, 0, 0, 0};
    }
    return {};
  }();
  const auto pick = [](double given, double otherwise) { return given >= 0 ? given : otherwise; };
  return {pick(c.speed_m_s, defaults.speed_m_s), kDegree * pick(c.rate_deg_s, defaults.rate_deg_s),
          kDegree * pick(c.sway_deg, defaults.sway_deg), 1e-3 * pick(c.vibration_mm, defaults.vibration_mm),
          kDegree * pick(c.vibration_deg, defaults.vibration_deg)};
}

/// The flight of a kind over flight time, which does not count the rest at the start.
struct Plan {
  std::function<Vector3d(double t_s)> position;   ///< map frame
  std::function<double(double t_s)> yaw;          ///< rad
  std::function<double(double t_s)> sway_factor;  ///< scales slow rotation and bank
  double duration_s = 10;
};

Eigen::Quaterniond about_z(double angle) { return so3::exp({0, 0, angle}); }

/// From volume to map: forward, left, up off the centre.
std::function<Vector3d(const Vector3d&)> volume_to_map(const TrajectoryConfig& c) {
  const Vector3d centre(c.centre_x_m, c.centre_y_m, c.centre_z_m);
  const Eigen::Quaterniond q = about_z(kDegree * c.heading_deg);
  return [centre, q](const Vector3d& p) -> Vector3d { return centre + q * p; };
}

Error duration_error(double duration_s) {
  return {"trajectory.speed_m_s", text("the flight takes ", duration_s, " s"),
          text("fly faster, or give a duration up to ", kLongest_s, " s")};
}

Plan plan_landing(const TrajectoryConfig& c, const MotionLimits& v, Random& random) {
  const auto to_map = volume_to_map(c);
  const Vector3d start(c.start_forward_m, c.start_left_m, c.start_height_m), end(0, 0, c.end_height_m);
  constexpr double kAbove = 0.7;   // of the descent is flown when the body is above the pad
  constexpr double kPeak = 1.875;  // of the mean speed of minimum_jerk()
  const auto gusts = random_waves(random, 0.15, 1.2);
  const auto path = [=](double descent_s) {
    return [=](double t) -> Vector3d {
      const double u = t / descent_s, down = minimum_jerk(u), across = minimum_jerk(u / kAbove);
      const double calm = 1 - down;
      const Vector3d sway = c.wind_m * calm * Vector3d(1, 1, 0.3).cwiseProduct(gusts(t));
      return {std::lerp(start.x(), end.x(), across) + sway.x(),
              std::lerp(start.y(), end.y(), across) + sway.y(),
              std::lerp(start.z(), end.z(), down) + sway.z()};
    };
  };
  double descent_s = kPeak * (end - start).norm() / v.speed_m_s;
  for (int i = 0; i < 20; ++i) {  // the gusts add to the speed
    const double excess = peak_speed(path(descent_s), descent_s) / v.speed_m_s;
    if (excess <= 1) break;
    descent_s *= std::min(2.0, std::max(excess, 1.001));
  }
  constexpr double kStand_s = 1;
  Plan plan;
  plan.position = [to_map, p = path(descent_s)](double t) { return to_map(p(t)); };
  plan.sway_factor = [descent_s](double t) { return 1 - minimum_jerk(t / descent_s); };
  plan.duration_s = descent_s + kStand_s;
  return plan;
}

Plan plan_hover(const TrajectoryConfig& c, const MotionLimits& v, Random& random) {
  const auto drift = random_waves(random, 0.06, 0.4);
  const Vector3d half = 0.5 * Vector3d(c.size_forward_m, c.size_left_m, c.size_up_m);
  Plan plan;
  plan.duration_s = c.duration_s > 0 ? c.duration_s : 30;
  const double unit_speed = peak_speed(drift, plan.duration_s);
  // Stays in the volume: the waves sum up to at most sqrt(10).
  const double scale = std::min(v.speed_m_s / unit_speed, half.minCoeff() / std::sqrt(10.0));
  plan.position = [to_map = volume_to_map(c), drift, scale](double t) { return to_map(scale * drift(t)); };
  return plan;
}

Expected<Plan> plan_traverse(const TrajectoryConfig& c, const MotionLimits& v) {
  const Vector3d half = 0.5 * Vector3d(c.size_forward_m, c.size_left_m, c.size_up_m);
  constexpr double kWave_m = 25, kUpWave_m = 37;  // lengths of the weaving
  const auto curve = [=](double a) -> Vector3d {
    return {a - half.x(), half.y() * std::sin(2 * kPi * a / kWave_m),
            half.z() * std::sin(2 * kPi * a / kUpWave_m)};
  };
  double length = 0;
  constexpr int kSteps = 2000;
  for (int i = 0; i < kSteps; ++i)
    length += (curve(2 * half.x() * (i + 1) / kSteps) - curve(2 * half.x() * i / kSteps)).norm();
  Plan plan;
  plan.duration_s = length / v.speed_m_s + kStart_s;
  if (plan.duration_s > kLongest_s) return duration_error(plan.duration_s);
  const auto flown = at_constant_speed(curve, v.speed_m_s, plan.duration_s, 2 * half.x());
  plan.position = [to_map = volume_to_map(c), flown](double t) { return to_map(flown(t)); };
  return plan;
}

Expected<Plan> plan_waypoints(const TrajectoryConfig& c, const MotionLimits& v) {
  auto points = read_waypoints(c.file);
  if (!points) return points.error();
  struct Stop {
    double t_s;
    Vector3d position;
    double yaw;
  };
  std::vector<Stop> stops;
  double t = 0, yaw = kDegree * points->front().yaw_deg;
  Vector3d position = points->front().position;
  for (const Waypoint& point : *points) {
    const double turn = std::remainder(kDegree * point.yaw_deg - yaw, 2 * kPi);
    double leg_s = (point.position - position).norm() / v.speed_m_s;
    if (v.rate_rad_s > 0) leg_s = std::max(leg_s, std::abs(turn) / v.rate_rad_s);
    t += leg_s;
    position = point.position;
    yaw += turn;
    stops.push_back({t, position, yaw});
    t += point.pause_s;
    if (point.pause_s > 0) stops.push_back({t, position, yaw});
    if (!(t < kLongest_s))
      return Error{c.file, text("takes ", t, " s at this speed"), text("stay below ", kLongest_s, " s")};
  }
  const auto between = [stops](double time_s, auto part) {
    const auto next = std::upper_bound(stops.begin(), stops.end(), time_s,
                                       [](double value, const Stop& stop) { return value < stop.t_s; });
    if (next == stops.begin()) return part(stops.front());
    if (next == stops.end()) return part(stops.back());
    const Stop& a = *(next - 1);
    const double u = (time_s - a.t_s) / (next->t_s - a.t_s);
    decltype(part(a)) mixed = (1 - u) * part(a) + u * part(*next);
    return mixed;
  };
  Plan plan;
  plan.position = [between](double time_s) {
    return between(time_s, [](const Stop& s) -> Vector3d { return s.position; });
  };
  plan.yaw = [between](double time_s) { return between(time_s, [](const Stop& s) { return s.yaw; }); };
  plan.duration_s = t + kStart_s;
  return plan;
}

Expected<Plan> make_plan(const TrajectoryConfig& c, const MotionLimits& v) {
  Random random(static_cast<std::uint64_t>(c.seed), 1);
  const Vector3d half = 0.5 * Vector3d(c.size_forward_m, c.size_left_m, c.size_up_m);
  Plan plan;
  const double flight_s = c.duration_s > 0 ? c.duration_s : plan.duration_s;
  const auto in_volume = [&](const std::function<Vector3d(double)>& p) {
    plan.position = [to_map = volume_to_map(c), p](double t) { return to_map(p(t)); };
    return plan;
  };
  if (v.speed_m_s <= 0 && (c.kind == Kind::landing || c.kind == Kind::traverse || c.kind == Kind::waypoints))
    return Error{"trajectory.speed_m_s", "0 never gets there", "give a speed above 0"};
  switch (c.kind) {
    case Kind::landing:
      return plan_landing(c, v, random);
    case Kind::hover:
      return plan_hover(c, v, random);
    case Kind::traverse:
      return plan_traverse(c, v);
    case Kind::waypoints:
      return plan_waypoints(c, v);
    case Kind::square_spiral:
      if (std::min(half.y(), half.z()) <= 0)
        return Error{"trajectory.size_up_m", "a square spiral needs a volume", "give sizes above 0"};
      return in_volume(at_constant_speed(square_spiral(half, random), v.speed_m_s, flight_s, 1e9));
    case Kind::sweep:
      return in_volume(
          with_peak_speed(lissajous(half.cwiseProduct(Vector3d(0.15, 1, 0.15)), {0.37, 1, 0.61}, random),
                          v.speed_m_s, flight_s));
    default:
      return in_volume(with_peak_speed(lissajous(half, {0.71, 1, 1.37}, random), v.speed_m_s, flight_s));
  }
}

bool has_corners(Kind kind) { return kind == Kind::waypoints || kind == Kind::traverse; }

// Half widths of the rounding of corners and tilt, knots.
constexpr std::ptrdiff_t kCorner = 20, kTilt = 5;

/// Time of the start of the flight. Smoothing moves the first motion forward, which must not shorten the
/// rest.
double start_of_flight(const TrajectoryConfig& c) {
  if (c.rest_s <= 0) return 0;
  const auto early = static_cast<double>(2 * kTilt + 4 + (has_corners(c.kind) ? 2 * kCorner : 0));
  return c.rest_s + kKnot_s * early;
}

/// Flight time at a time of the recording.
double flight_time(double t_s, double rest_s) {
  if (rest_s <= 0) return t_s;
  const double u = std::max(0.0, t_s - rest_s) / kStart_s;
  return kStart_s * (u < 1 ? u * u * u * (1 - 0.5 * u) : u - 0.5);
}

/// Slow rotation back and forth about z, y and x with about the given peak rate.
std::function<Vector3d(double)> slow_rotation(const MotionLimits& v, Random& random) {
  const Vector3d amplitude = v.sway_rad * Vector3d(0.55, 0.6, 1);
  const double omega = v.sway_rad > 0 ? v.rate_rad_s / (1.6 * v.sway_rad) : 0;
  Eigen::Matrix<double, 3, 2> phase;
  for (int i = 0; i < 6; ++i) phase(i / 2, i % 2) = random.uniform(0, 2 * kPi);
  return [=](double t) -> Vector3d {
    Vector3d angle;
    const double ratio[] = {1.27, 1.13, 1};
    for (int axis = 0; axis < 3; ++axis)
      angle[axis] = amplitude[axis] * (0.8 * std::sin(ratio[axis] * omega * t + phase(axis, 0)) +
                                       0.2 * std::sin(2.9 * ratio[axis] * omega * t + phase(axis, 1)));
    return angle;
  };
}

/// Tilt, as a rotation vector in body axes, that gives a multicopter this acceleration.
Vector3d tilt(const Vector3d& acceleration, double yaw) {
  const Vector3d a = about_z(-yaw) * acceleration;
  const double g = -gravity_map().z();
  return {-std::atan2(a.y(), g), std::atan2(a.x(), g), 0};
}

PoseSpline plan_spline(const Plan& plan, const TrajectoryConfig& c, const MotionLimits& v,
                       double duration_s) {
  Random random(static_cast<std::uint64_t>(c.seed), 2);
  const auto count = static_cast<std::size_t>(std::ceil(duration_s / kKnot_s)) + 8;
  const double rest_s = start_of_flight(c);
  std::vector<Vector3d> position(count), turn(count);
  std::vector<double> yaw(count);
  const auto sway = slow_rotation(v, random);
  const double heading = kDegree * c.heading_deg;
  for (std::size_t k = 0; k < count; ++k) {
    const double t = flight_time(kKnot_s * static_cast<double>(k), rest_s);
    position[k] = plan.position(t);
    yaw[k] = (plan.yaw ? plan.yaw(t) : heading) + kDegree * c.turn_deg_s * t;
    turn[k] = sway(t);
  }
  if (has_corners(c.kind))
    position = smooth(std::move(position), kCorner), yaw = smooth(std::move(yaw), kCorner);
  std::vector<Vector3d> bank(count, Vector3d::Zero());
  for (std::size_t k = 1; k + 1 < count; ++k)
    bank[k] =
        c.bank * tilt((position[k + 1] - 2 * position[k] + position[k - 1]) / (kKnot_s * kKnot_s), yaw[k]);
  bank[0] = bank[1];
  bank[count - 1] = bank[count - 2];
  bank = smooth(std::move(bank), kTilt);
  for (std::size_t k = 0; k < count; ++k) {
    turn[k] += bank[k];
    if (plan.sway_factor) turn[k] *= plan.sway_factor(flight_time(kKnot_s * static_cast<double>(k), rest_s));
  }
  // Before the recording it moves as after it, the other way round: it begins in flight, not with a jerk.
  constexpr std::size_t kLead = PoseSpline::kReach;
  const auto spline = [&](double fraction) {
    const auto extended = [](const auto& values, std::size_t k) {
      using Value = std::decay_t<decltype(values[0])>;
      return k >= kLead ? values[k - kLead] : Value(2 * values[0] - values[kLead - k]);
    };
    std::vector<Pose> control(kLead + count);
    for (std::size_t k = 0; k < control.size(); ++k)
      control[k] = {about_z(extended(yaw, k)) * so3::exp(fraction * extended(turn, k)),
                    extended(position, k)};
    return PoseSpline(kKnot_s, std::move(control), -kKnot_s * static_cast<double>(kLead));
  };
  // Scales slow rotation and bank to the largest size whose peak rate stays below the limit.
  const auto peak_rate = [&](double fraction) {
    const PoseSpline s = spline(fraction);
    double most = 0;
    for (double t = 0; t <= duration_s; t += kKnot_s) most = std::max(most, s.at(t).rate.norm());
    return most;
  };
  double low = 0, high = v.sway_rad > 0 ? 2 : 1;
  if (peak_rate(high) <= v.rate_rad_s) return spline(high);
  for (int i = 0; i < 12; ++i) {
    const double fraction = 0.5 * (low + high);
    (peak_rate(fraction) > v.rate_rad_s ? high : low) = fraction;
  }
  return spline(low);
}

std::vector<Trajectory::Wave> vibration(const TrajectoryConfig& c, const MotionLimits& v) {
  if (v.vibration_m <= 0 && v.vibration_rad <= 0) return {};
  Random random(static_cast<std::uint64_t>(c.seed), 3);
  Trajectory::Wave wave;
  wave.frequency_hz = c.vibration_hz;
  for (int axis = 0; axis < 3; ++axis) wave.phase_rad[axis] = random.uniform(0, 2 * kPi);
  wave.position_m = v.vibration_m * Vector3d(0.6, 0.6, 1);
  wave.attitude_rad = v.vibration_rad * Vector3d(1, 1, 0.5);
  return {wave};
}

struct FlownSpline {
  PoseSpline spline;
  double duration_s;
};
Expected<FlownSpline> fit_file(const TrajectoryConfig& c) {
  auto rows = read_trajectory(c.file);
  if (!rows) return rows.error();
  if (rows->size() < 2) return Error{c.file, "one pose is no trajectory", "give two or more"};
  std::vector<double> t_s;
  std::vector<Pose> poses;
  for (const TimedPose& row : *rows) {
    t_s.push_back(to_seconds(row.t - rows->front().t));
    poses.push_back(row.pose);
    constexpr double kFarthest_m = 1e6;
    if (!(row.pose.p.cwiseAbs().maxCoeff() <= kFarthest_m))
      return Error{c.file, text("a position beyond ", kFarthest_m, " m"), "metres are wanted"};
  }
  if (t_s.back() > kLongest_s)
    return Error{c.file, text("covers ", t_s.back(), " s"), text("cut it to ", kLongest_s, " s or less")};
  PoseSpline spline = PoseSpline::fit(t_s, poses, c.file_knot_s);
  const double rest_s = start_of_flight(c);
  if (rest_s <= 0) return FlownSpline{std::move(spline), t_s.back()};
  std::vector<Pose> control;
  const double end_s = t_s.back() + rest_s + 0.5 * kStart_s;
  for (std::size_t k = 0; kKnot_s * static_cast<double>(k) < end_s + 8 * kKnot_s; ++k)
    control.push_back(spline.at(flight_time(kKnot_s * static_cast<double>(k), rest_s)).T_map_body);
  return FlownSpline{PoseSpline(kKnot_s, std::move(control)), end_s};
}

}  // namespace

Expected<Trajectory> make_trajectory(const TrajectoryConfig& c) {
  const MotionLimits values = motion_limits(c);
  if ((c.kind == Kind::file || c.kind == Kind::waypoints) && c.file.empty())
    return Error{"trajectory.file", "no file named", "name the file of the trajectory"};
  if (c.kind == Kind::file) {
    auto flown = fit_file(c);
    if (!flown) return flown.error();
    const double duration_s = c.duration_s > 0 ? c.duration_s : flown->duration_s;
    return Trajectory(std::move(flown->spline), vibration(c, values), duration_s);
  }
  auto plan = make_plan(c, values);
  if (!plan) return plan.error();
  const double duration_s = c.duration_s > 0
                                ? c.duration_s
                                : plan->duration_s + (c.rest_s > 0 ? start_of_flight(c) + 0.5 * kStart_s : 0);
  if (duration_s > kLongest_s) return duration_error(duration_s);
  return Trajectory(plan_spline(*plan, c, values, duration_s), vibration(c, values), duration_s);
}

}  // namespace evpose::sim
