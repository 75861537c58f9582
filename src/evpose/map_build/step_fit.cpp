// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_build/step_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <optional>

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

/// Points in a strip of |t| <= half_length, |d| <= half_width.
struct Strip {
  std::span<const Eigen::Vector2d> points;
  double half_length, half_width;

  double log_likelihood(const Step& step) const;
  std::optional<Step> first_guess(double blur_m) const;
};

/// But for constants.
double Strip::log_likelihood(const Step& step) const {
  double sum = 0;
  for (const auto& p : points) sum += std::log(step.at(p.x(), p.y()));
  return sum - 2 * half_length * (step.inside * filled(step, half_width) + step.outside * 2 * half_width);
}

/// Densities of the inner and the outer quarter, the place from the count between.
std::optional<Step> Strip::first_guess(double blur_m) const {
  double inner = 0, outer = 0;
  for (const auto& p : points) {
    inner += p.y() < -half_width / 2 ? 1 : 0;
    outer += p.y() > half_width / 2 ? 1 : 0;
  }
  const double quarter = 2 * half_length * half_width / 2;
  const double all = static_cast<double>(points.size());
  if (inner < 5) return {};
  Step step{0, 0, blur_m, inner / quarter, (outer + 0.1) / quarter};
  step.inside = std::max(step.inside - step.outside, 0.1 * step.inside);
  const double balanced =
      (all / (2 * half_length) - step.outside * 2 * half_width) / step.inside - half_width;
  step.place = std::clamp(balanced, -0.9 * half_width, 0.9 * half_width);
  return step;
}

/// Fisher scoring in place, slope and inner density (relative).
struct Scores {
  Eigen::Vector3d gradient;
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  double beyond = 0;  ///< points that the outer density explains
};

Scores scores_of(const Strip& strip, const Step& step) {
  Scores out;
  out.gradient = {-2 * strip.half_length * step.inside * filled_slope(step, strip.half_width), 0,
                  -2 * strip.half_length * step.inside * filled(step, strip.half_width)};
  for (const auto& p : strip.points) {
    const double x = (p.y() - step.place - step.slope * p.x()) / step.blur;
    const double density = step.at(p.x(), p.y());
    const double slope = step.inside * density_of(x) / step.blur / density;
    const Eigen::Vector3d j(slope, slope * p.x(), step.inside * share_above(x) / density);
    out.gradient += j;
    out.information += j * j.transpose();
    out.beyond += step.outside / density;
  }
  out.information.diagonal() += Eigen::Vector3d(1e-6, 1e-6, 1e-6);
  return out;
}

/// Length of a move in metres.
double length_of(const Eigen::Vector3d& move, const Strip& strip) {
  return std::max(std::abs(move.x()), std::abs(move.y()) * strip.half_length);
}

/// Moves uphill only: the move is halved until the points become likelier. Returns the gain in likelihood of
/// the last trial.
double climb(const Strip& strip, const Eigen::Vector3d& move, double beyond, Step& step, double& likelihood) {
  double gain = 0;
  for (double share = std::min(1.0, 2 * step.blur / std::max(length_of(move, strip), 1e-9)); share > 1e-3;
       share *= 0.5) {
    Step next = step;
    next.place += share * move.x();
    next.slope += share * move.y();
    next.inside *= std::exp(std::clamp(share * move.z(), -0.5, 0.5));
    next.outside = std::max(beyond, 0.1) / (4 * strip.half_length * strip.half_width);
    if (!(std::abs(next.place) < strip.half_width) || !(std::abs(next.slope) < 0.5)) continue;
    const double now = strip.log_likelihood(next);
    gain = now - likelihood;
    if (gain < 0) continue;
    step = next;
    likelihood = now;
    break;
  }
  return gain;
}

}  // namespace

StepFit fit_step(std::span<const Eigen::Vector2d> points, double half_length, double half_width,
                 double blur_m) {
  StepFit out;
  out.blur_m = blur_m;
  if (points.size() < 10) return out;
  const Strip strip{points, half_length, half_width};
  const std::optional<Step> guess = strip.first_guess(blur_m);
  if (!guess) return out;
  Step step = *guess;
  Eigen::Matrix3d information = Eigen::Matrix3d::Identity();
  constexpr int kMostRounds = 60;
  constexpr double kNoGain = 1e-3;
  double likelihood = strip.log_likelihood(step);
  for (int round = 0; round < kMostRounds; ++round) {
    const Scores scores = scores_of(strip, step);
    information = scores.information;
    const Eigen::Vector3d move = information.ldlt().solve(scores.gradient);
    const double longest = length_of(move, strip);
    if (!(longest < 1e3)) return out;
    const double gain = climb(strip, move, scores.beyond, step, likelihood);
    if (gain < kNoGain) {
      out.converged = gain > -kNoGain || longest < 0.1 * step.blur;
      break;
    }
  }
  out.place = step.place;
  out.slope = step.slope;
  const Eigen::Matrix3d covariance = information.inverse();
  if (!(covariance(0, 0) > 0 && covariance(1, 1) > 0)) out.converged = false;
  out.sigma_place = std::sqrt(covariance(0, 0));
  out.sigma_slope = std::sqrt(covariance(1, 1));
  out.rest = step.outside / step.inside;
  out.density = step.inside;
  out.log_likelihood = likelihood;
  return out;
}

}  // namespace evpose::map_build
