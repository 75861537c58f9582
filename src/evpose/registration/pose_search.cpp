// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/pose_search.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <random>

#include "evpose/core/config.h"

namespace evpose {
namespace {

constexpr double kOutside = -0.3;   // log-odds of a point that has left the image: neither good nor bad
constexpr double kCorrelated = 10;  // so many points share one error
constexpr int kIterations = 5;      // at each width
constexpr double kNarrowest_px = 1;
constexpr double kSame_px = 3;  // poses that move the points by less are one
constexpr double kTypicalDepth_m = 3;

double uniform(std::mt19937& random) { return (static_cast<double>(random()) + 0.5) / 4294967296.0; }

/// Two independent standard normal numbers are made of two uniform ones: the same on every platform.
Vector6d standard_normal(std::mt19937& random) {
  Vector6d out;
  for (int i = 0; i < 6; i += 2) {
    const double r = std::sqrt(-2 * std::log(uniform(random))), angle = 2 * M_PI * uniform(random);
    out(i) = r * std::cos(angle);
    out(i + 1) = r * std::sin(angle);
  }
  return out;
}

struct Projector {
  Projector(const SearchView& view, const Pose& T_map_body) : camera(view.camera), size(camera.size()) {
    const Pose T_cam_map = (T_map_body * view.T_body_cam).inverse();
    R = T_cam_map.rotation();
    p = T_cam_map.p;
  }
  /// Pixel and direction number; false outside of the image.
  bool operator()(const SearchPoint& point, Eigen::Vector2d* pixel, int* direction, Matrix23d* jacobian,
                  Eigen::Vector3d* x_cam) const {
    *x_cam = R * point.position + p;
    if (x_cam->z() < 0.05) return false;
    const auto u = camera.project(*x_cam, jacobian);
    if (!u || !size.contains(*u, 2)) return false;
    const Eigen::Vector2d along = *jacobian * (R * point.tangent);
    *pixel = *u;
    *direction = EdgeField::direction(along.x(), along.y());
    return true;
  }
  const Camera& camera;
  ImageSize size;
  Eigen::Matrix3d R;
  Eigen::Vector3d p;
};

bool same(const Pose& a, const Pose& b, double focal_px) {
  const Vector6d d = a.minus(b);
  return focal_px * (d.head<3>().norm() / kTypicalDepth_m + d.tail<3>().norm()) < kSame_px;
}

void keep_different(std::vector<PoseGuess>& guesses, std::size_t most, double focal_px) {
  std::stable_sort(guesses.begin(), guesses.end(),
                   [](const PoseGuess& a, const PoseGuess& b) { return a.score > b.score; });
  std::vector<PoseGuess> out;
  for (const PoseGuess& g : guesses) {
    if (out.size() == most) break;
    if (std::none_of(out.begin(), out.end(),
                     [&](const PoseGuess& o) { return same(o.T_map_body, g.T_map_body, focal_px); }))
      out.push_back(g);
  }
  guesses = std::move(out);
}

}  // namespace

void describe(ConfigTable& table, PoseSearchConfig& c) {
  table.add("guesses", c.guesses, "", "poses drawn from the prior", {1, 1e7});
  table.add("refined", c.refined, "", "the best of them are refined", {1, 1e5});
  table.add("kept", c.kept, "", "the best of these are followed", {1, 1000});
  table.add("coarse_px", c.coarse_px, "px", "edges lie so far from contours when guesses are compared",
            {1, 20});
  table.add("fine_px", c.fine_px, "px", "... and when refined poses are", {0.3, 10});
  table.add("seen_share", c.seen_share, "", "share of the contours in view that make events", {0.01, 0.99});
}

double PoseSearch::score(const SearchView& view, const Pose& T_map_body, int spread, std::size_t step) const {
  const Projector project(view, T_map_body);
  const auto seen = static_cast<float>(config_.seen_share);
  double sum = 0;
  std::size_t count = 0;
  Eigen::Vector2d pixel;
  Eigen::Vector3d x_cam;
  Matrix23d jacobian;
  int direction = 0;
  for (std::size_t i = 0; i < view.points.size(); i += step, ++count)
    sum += project(view.points[i], &pixel, &direction, &jacobian, &x_cam)
               ? std::log(1 - seen + seen * view.field.odds(pixel.x(), pixel.y(), direction, spread))
               : kOutside;
  return count > 0 ? sum / static_cast<double>(count) : 0;
}

PoseGuess PoseSearch::refine(const SearchView& view, const Pose& from, const Matrix6d& prior_information,
                             double from_px) const {
  Pose pose = from;
  const Eigen::Matrix3d R_cam_body = view.T_body_cam.rotation().transpose();
  const double seen = config_.seen_share, middle_px = std::sqrt(config_.coarse_px * config_.fine_px);
  for (double width = from_px; width >= kNarrowest_px; width *= 0.6)
    for (int iteration = 0; iteration < kIterations; ++iteration) {
      const Projector project(view, pose);
      const Eigen::Matrix3d R_body_map = pose.rotation().transpose();
      Matrix6d H = prior_information;
      Vector6d b = -prior_information * pose.minus(from);
      Eigen::Vector2d pixel;
      Eigen::Vector3d x_cam;
      Matrix23d J;
      int direction = 0;
      for (const SearchPoint& point : view.points) {
        if (!project(point, &pixel, &direction, &J, &x_cam)) continue;
        const EdgeField::Sample s = view.field.sample(pixel.x(), pixel.y(), direction);
        const double g = std::exp(-0.5 * s.distance * s.distance / (width * width));
        const double chance = view.field.chance(pixel.x(), pixel.y(), direction, width > middle_px ? 0 : 1);
        const double w = seen * g / (seen * g + (1 - seen) * chance) / (width * width * kCorrelated);
        const Eigen::RowVector3d A = Eigen::RowVector2d(s.dx, s.dy) * J * R_cam_body;
        Vector6d row;  // derivative of the distance by the pose
        row.head<3>() = -(A * R_body_map).transpose();
        row.tail<3>() = -(view.T_body_cam * x_cam).cross(A.transpose());
        H += w * row * row.transpose();
        b -= w * s.distance * row;
      }
      H.diagonal() *= 1 + 1e-6;
      const Vector6d step = H.ldlt().solve(b);
      if (!step.allFinite()) break;
      pose = pose.plus(step);
      if (view.camera.focal_px() * (step.head<3>().norm() / kTypicalDepth_m + step.tail<3>().norm()) <
          0.05 * width)
        break;
    }
  return {pose, score(view, pose, 1)};
}

std::vector<PoseGuess> PoseSearch::search(const SearchView& view, const Pose& prior,
                                          const Matrix6d& covariance, unsigned seed) const {
  std::mt19937 random(seed);
  const Matrix6d root = covariance.llt().matrixL();
  const std::size_t step = std::max<std::size_t>(1, view.points.size() / 200);
  std::vector<PoseGuess> guesses;
  for (int i = 0; i < config_.guesses; ++i) {
    // The prior itself is the first guess.
    const Pose pose = i == 0 ? prior : prior.plus(root * standard_normal(random));
    guesses.push_back({pose, score(view, pose, 0, step)});
  }
  const double focal = view.camera.focal_px();
  const PoseGuess first = guesses.front();
  keep_different(guesses, static_cast<std::size_t>(config_.refined), focal);
  guesses.push_back(first);
  const Matrix6d information = covariance.ldlt().solve(Matrix6d::Identity());
  const double evidence = static_cast<double>(view.points.size()) / kCorrelated;
  for (PoseGuess& g : guesses) {
    g = refine(view, g.T_map_body, information, 2 * config_.coarse_px);
    const Vector6d off = g.T_map_body.minus(prior);
    g.score -= 0.5 * off.dot(information * off) / evidence;
  }
  keep_different(guesses, static_cast<std::size_t>(config_.kept), focal);
  return guesses;
}

}  // namespace evpose
