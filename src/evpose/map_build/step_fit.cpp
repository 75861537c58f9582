// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_build/step_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "evpose/map_build/normal_table.h"

namespace evpose::map_build {
namespace {

double density_of(double x) { return normal().density(x); }
double share_above(double x) { return normal().below(-x); }

struct Step {
  double place, slope, blur, inside, outside;  // densities per square metre
  double at(double t, double d) const {
    return inside * share_above((d - place - slope * t) / blur) + outside;
  }
};

/// Width of the strip |d| <= half_width that the step fills, and its derivative in the place. In closed form
/// for a small slope, whose first order cancels.
double filled(const Step& step, double half_width) {
  return step.blur * (normal().ramp((step.place + half_width) / step.blur) -
                      normal().ramp((step.place - half_width) / step.blur));
}
double filled_slope(const Step& step, double half_width) {
  return share_above(-(step.place + half_width) / step.blur) -
         share_above(-(step.place - half_width) / step.blur);
}

/// Log likelihood but for constants.
double log_likelihood(std::span<const Eigen::Vector2d> points, const Step& step, double half_length,
                      double half_width) {
  double sum = 0;
  for (const auto& p : points) sum += std::log(step.at(p.x(), p.y()));
  return sum - 2 * half_length * (step.inside * filled(step, half_width) + step.outside * 2 * half_width);
}

}  // namespace

StepFit fit_step(std::span<const Eigen::Vector2d> points, double half_length, double half_width,
                 double blur_m) {
  StepFit out;
  out.blur_m = blur_m;
  if (points.size() < 10) return out;
  // First guess: densities of the inner and the outer quarter, the place from the count between.
  double inner = 0, outer = 0;
  for (const auto& p : points) {
    inner += p.y() < -half_width / 2 ? 1 : 0;
    outer += p.y() > half_width / 2 ? 1 : 0;
  }
  const double quarter = 2 * half_length * half_width / 2;
  const double all = static_cast<double>(points.size());
  if (inner < 5) return out;
  Step step{0, 0, blur_m, inner / quarter, (outer + 0.1) / quarter};
  step.inside = std::max(step.inside - step.outside, 0.1 * step.inside);
  const auto balanced = [&] {
    return (all / (2 * half_length) - step.outside * 2 * half_width) / step.inside - half_width;
  };
  step.place = std::clamp(balanced(), -0.9 * half_width, 0.9 * half_width);
  Eigen::Matrix3d information = Eigen::Matrix3d::Identity();
  constexpr int kMostRounds = 60;
  constexpr double kNoGain = 1e-3;
  double likelihood = log_likelihood(points, step, half_length, half_width);
  for (int round = 0; round < kMostRounds; ++round) {
    // Fisher scoring in place, slope and inner density (relative); the rest by expectation.
    Eigen::Vector3d gradient(-2 * half_length * step.inside * filled_slope(step, half_width), 0,
                             -2 * half_length * step.inside * filled(step, half_width));
    information.setZero();
    double beyond = 0;
    for (const auto& p : points) {
      const double x = (p.y() - step.place - step.slope * p.x()) / step.blur;
      const double density = step.at(p.x(), p.y());
      const double slope = step.inside * density_of(x) / step.blur / density;
      const Eigen::Vector3d j(slope, slope * p.x(), step.inside * share_above(x) / density);
      gradient += j;
      information += j * j.transpose();
      beyond += step.outside / density;
    }
    information.diagonal() += Eigen::Vector3d(1e-6, 1e-6, 1e-6);
    const Eigen::Vector3d move = information.ldlt().solve(gradient);
    const double longest = std::max(std::abs(move.x()), std::abs(move.y()) * half_length);
    if (!(longest < 1e3)) return out;
    // Only uphill: the step is halved until the points become likelier.
    Step best = step;
    double gain = 0;
    for (double share = std::min(1.0, 2 * step.blur / std::max(longest, 1e-9)); share > 1e-3; share *= 0.5) {
      Step next = step;
      next.place += share * move.x();
      next.slope += share * move.y();
      next.inside *= std::exp(std::clamp(share * move.z(), -0.5, 0.5));
      next.outside = std::max(beyond, 0.1) / (4 * half_length * half_width);
      if (!(std::abs(next.place) < half_width) || !(std::abs(next.slope) < 0.5)) continue;
      const double now = log_likelihood(points, next, half_length, half_width);
      gain = now - likelihood;
      if (gain < 0) continue;
      best = next;
      likelihood = now;
      break;
    }
    step = best;
    if (gain < kNoGain) {
      out.converged = gain > -kNoGain || longest < 0.1 * step.blur;
      break;
    }
  }
  out.place = step.place;
  out.slope = step.slope;
  const Eigen::Matrix3d covariance = information.inverse();
  out.sigma_place = std::sqrt(covariance(0, 0));
  out.sigma_slope = std::sqrt(covariance(1, 1));
  out.rest = step.outside / step.inside;
  out.density = step.inside;
  out.log_likelihood = likelihood;
  return out;
}

}  // namespace evpose::map_build
