// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/flight/trajectory_curves.h"

#include <array>
#include <cmath>
#include <numbers>

namespace evpose::sim {
namespace {

using Eigen::Vector3d;

constexpr double kPi = std::numbers::pi;

}  // namespace

double peak_speed(const Curve& position, double duration_s) {
  constexpr double kStep_s = 0.02;  // finer than any motion in the curves
  const int steps = std::max(4000, static_cast<int>(duration_s / kStep_s));
  const double step = duration_s / steps;
  double most = 0;
  Vector3d before = position(0);
  for (int i = 1; i <= steps; ++i) {
    const Vector3d now = position(step * i);
    most = std::max(most, (now - before).norm() / step);
    before = now;
  }
  return most;
}

Curve with_peak_speed(Curve curve, double speed_m_s, double duration_s) {
  double low = 0, high = 1e3;
  for (int i = 0; i < 60; ++i) {
    const double pace = 0.5 * (low + high);
    const bool too_fast = peak_speed([&](double t) { return curve(pace * t); }, duration_s) > speed_m_s;
    (too_fast ? high : low) = pace;
  }
  return [curve = std::move(curve), pace = low](double t) { return curve(pace * t); };
}

Curve at_constant_speed(const Curve& curve, double speed_m_s, double duration_s, double end) {
  constexpr double kStep_s = 1e-3;
  constexpr double kDifference = 1e-5;
  std::vector<double> parameter = {0};
  while (static_cast<double>(parameter.size()) * kStep_s < duration_s + 1 && parameter.back() < end) {
    const auto slope = [&](double a) {
      return speed_m_s / ((curve(a + kDifference) - curve(a - kDifference)).norm() / (2 * kDifference));
    };
    const double a = parameter.back(), middle = a + 0.5 * kStep_s * slope(a);
    parameter.push_back(std::min(end, a + kStep_s * slope(middle)));
  }
  return [curve, parameter = std::move(parameter)](double t) {
    const double place = std::clamp(t / kStep_s, 0.0, static_cast<double>(parameter.size() - 1));
    const auto i = std::min(static_cast<std::size_t>(place), parameter.size() - 1);
    const auto j = std::min(i + 1, parameter.size() - 1);
    return curve(std::lerp(parameter[i], parameter[j], place - static_cast<double>(i)));
  };
}

Curve random_waves(Random& random, double low_hz, double high_hz) {
  struct Wave {
    Vector3d amplitude, omega, phase;
  };
  std::array<Wave, 5> waves;
  for (Wave& w : waves)
    for (int axis = 0; axis < 3; ++axis) {
      const double hz = low_hz * std::pow(high_hz / low_hz, random.uniform());
      w.omega[axis] = 2 * kPi * hz;
      w.amplitude[axis] = std::sqrt(2.0 / waves.size());
      w.phase[axis] = random.uniform(0, 2 * kPi);
    }
  return [waves](double t) {
    Vector3d sum = Vector3d::Zero();
    for (const Wave& w : waves)
      for (int axis = 0; axis < 3; ++axis)
        sum[axis] += w.amplitude[axis] * std::sin(w.omega[axis] * t + w.phase[axis]);
    return sum;
  };
}

Curve lissajous(const Vector3d& half, const Vector3d& ratio, Random& random) {
  const Vector3d phase(random.uniform(0, 2 * kPi), random.uniform(0, 2 * kPi), random.uniform(0, 2 * kPi));
  return [=](double a) -> Vector3d { return half.cwiseProduct(Vector3d((ratio * a + phase).array().sin())); };
}

Curve square_spiral(const Vector3d& half, Random& random) {
  constexpr double kTurns = 4;  // out
  constexpr double kSmallest = 0.25;
  constexpr double kSquare =
      0.1;                        // amplitude of the third harmonic that turns a circle into a rounded square
  constexpr double kDepth = 0.3;  // of the volume, back and forth along the heading
  const double side = std::min(half.y(), half.z()) / (1 - kSquare);
  const double start = random.uniform(0, 2 * kPi), depth_phase = random.uniform(0, 2 * kPi);
  return [=](double a) -> Vector3d {
    const double open = 0.5 - 0.5 * std::cos(a / (2 * kTurns));
    const double radius = side * (kSmallest + (1 - kSmallest) * open);
    const double angle = a + start;
    return {kDepth * half.x() * std::sin(0.31 * a + depth_phase),
            radius * (std::cos(angle) - kSquare * std::cos(3 * angle)),
            radius * (std::sin(angle) + kSquare * std::sin(3 * angle))};
  };
}

double minimum_jerk(double u) {
  u = std::clamp(u, 0.0, 1.0);
  return u * u * u * (10 + u * (6 * u - 15));
}

}  // namespace evpose::sim
