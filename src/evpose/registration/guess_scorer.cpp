// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/guess_scorer.h"

#include <cmath>

namespace evpose {
namespace {

constexpr int kDraws = 120;
constexpr double kNarrowing = 0.98;  // of the steps, from one to the next: to a tenth

double uniform(std::mt19937& random) { return (static_cast<double>(random()) + 0.5) / 4294967296.0; }

}  // namespace

/// By the Box-Muller transform, unlike std::normal_distribution.
Vector6d standard_normal(std::mt19937& random) {
  Vector6d out;
  for (int i = 0; i < 6; i += 2) {
    const double r = std::sqrt(-2 * std::log(uniform(random))), angle = 2 * M_PI * uniform(random);
    out(i) = r * std::cos(angle);
    out(i + 1) = r * std::sin(angle);
  }
  return out;
}

GuessScorer::GuessScorer(const SearchView& view, const Eigen::Vector3d& origin, unsigned seed)
    : scores_(view.field, view.camera, static_cast<float>(kSeenShare), static_cast<float>(kOutsideScore)),
      T_body_cam_(view.T_body_cam),
      T_cam_body_(view.T_body_cam.inverse()),
      focal_px_(view.camera.focal_px()),
      half_width_px_(0.5 * view.camera.size().width),
      origin_(origin),
      random_(seed) {
  scores_.set_points(view.points, origin);
}

PoseGuess GuessScorer::turned(const Pose& T_map_body) const {
  const Pose T_map_cam = T_map_body * T_body_cam_, T_cam_map = T_map_cam.inverse();
  const auto best =
      scores_.best_turn(T_cam_map.rotation().cast<float>(), (T_cam_map * origin_).cast<float>());
  return {Pose{(T_map_cam.q * so3::exp(best.turn)).normalized(), T_map_cam.p} * T_cam_body_, best.score};
}

void GuessScorer::improve(PoseGuess& guess, double reach_px) {
  guess = turned(guess.T_map_body);
  for (int draw = 0; draw < kDraws; ++draw, reach_px *= kNarrowing) {
    Vector6d step = standard_normal(random_);
    step.head<3>() *= reach_px / focal_px_ * kTypicalDepth_m;
    step.tail<3>() *= reach_px / half_width_px_;
    const PoseGuess other = turned(guess.T_map_body.plus(step));
    if (other.score > guess.score) guess = other;
  }
}

}  // namespace evpose
