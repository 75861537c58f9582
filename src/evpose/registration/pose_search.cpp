// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/pose_search.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "evpose/core/keep_different.h"
#include "evpose/registration/guess_scorer.h"

namespace evpose {
namespace {

constexpr std::size_t kGuesses = 20000;  // with 256 turns of each
constexpr std::size_t kByPrior = 5;      // one of so many has the prior's attitude if others are told
constexpr std::size_t kRefined = 64;     // of the guesses
constexpr std::size_t kKept = 16;        // of the refined ones, for later slices to choose from
constexpr double kSeenShare = GuessScorer::kSeenShare, kOutsideScore = GuessScorer::kOutsideScore;
constexpr double kCorrelatedPoints = 10;                    // so many points share one error
constexpr std::size_t kRefinedPoints = 250;                 // enough to move a guess to its optimum
constexpr int kIterations = 3;                              // at each width of the kernel
constexpr double kFirstReach_px = 4;                        // of guesses: a wider one leaves them for texture
constexpr double kFirstSteps_px = 10, kSecondSteps_px = 5;  // before each of the two
constexpr double kLastReach_px = 3;                         // of the refinement with all points
constexpr double kNarrowing = 0.6;                          // of the kernel, from width to width
constexpr double kNarrowest_px = 1;                         // the sharpness of the edges
constexpr double kConverged = 0.05;      // a step below this share of the kernel's width ends the iterations
constexpr double kApart_px = 5;          // of those to refine: that far the turns and the refinement reach
constexpr std::size_t kSeenPoints = 12;  // by which poses are told apart
constexpr double kDifferent_px = 1;      // poses that see the points nearer to each other are one
constexpr double kNearest_m = 0.05;      // points nearer to the camera are not projected
constexpr double kMargin_px = 2;         // the field is interpolated inside of this

struct Projection {
  Eigen::Vector2d pixel;
  Matrix23d jacobian;     ///< of the pixel by x_cam
  Eigen::Vector3d x_cam;  ///< the point, camera frame
  int direction;          ///< bin of the contour's direction in the image
};

class Projector {
 public:
  Projector(const SearchView& view, const Pose& T_map_body) : camera_(view.camera), size_(camera_.size()) {
    const Pose T_cam_map = (T_map_body * view.T_body_cam).inverse();
    R_ = T_cam_map.rotation();
    p_ = T_cam_map.p;
  }
  /// Nothing if the point is not in the image.
  std::optional<Projection> operator()(const SearchPoint& point) const {
    Projection out;
    out.x_cam = R_ * point.position + p_;
    if (out.x_cam.z() < kNearest_m) return {};
    const auto pixel = camera_.project(out.x_cam, &out.jacobian);
    if (!pixel || !size_.contains(*pixel, kMargin_px)) return {};
    const Eigen::Vector2d along = out.jacobian * (R_ * point.tangent);
    out.pixel = *pixel;
    out.direction = EdgeField::direction(along.x(), along.y());
    return out;
  }

 private:
  const Camera& camera_;
  ImageSize size_;
  Eigen::Matrix3d R_;
  Eigen::Vector3d p_;
};

/// Motion of a point at the typical depth in the image, px.
double image_motion_px(const Vector6d& step, double focal_px) {
  return focal_px * (step.head<3>().norm() / kTypicalDepth_m + step.tail<3>().norm());
}

/// Normal equations of the distances between contours and edges at `pose`, weighted by a kernel of this
/// width, with the prior around `from`.
struct NormalEquations {
  Matrix6d H;
  Vector6d b;
};
NormalEquations linearise(const SearchView& view, const Pose& pose, const Pose& from,
                          const Matrix6d& prior_information, double width_px) {
  const Eigen::Matrix3d R_cam_body = view.T_body_cam.rotation().transpose();
  const double middle_px = std::sqrt(static_cast<double>(EdgeField::spread_px(EdgeSpread::coarse)) *
                                     EdgeField::spread_px(EdgeSpread::fine));
  const EdgeSpread spread = width_px > middle_px ? EdgeSpread::coarse : EdgeSpread::fine;
  const Projector project(view, pose);
  const Eigen::Matrix3d R_body_map = pose.rotation().transpose();
  NormalEquations out{prior_information, -prior_information * pose.minus(from)};
  for (const SearchPoint& point : view.points) {
    const std::optional<Projection> seen = project(point);
    if (!seen) continue;
    const double x = seen->pixel.x(), y = seen->pixel.y();
    const EdgeField::Sample s = view.field.sample(x, y, seen->direction);
    const double kernel = std::exp(-0.5 * s.distance * s.distance / (width_px * width_px));
    const double background = view.field.background(x, y, seen->direction, spread);
    const double w = kSeenShare * kernel / (kSeenShare * kernel + (1 - kSeenShare) * background) /
                     (width_px * width_px * kCorrelatedPoints);
    const Eigen::RowVector3d A = Eigen::RowVector2d(s.dx, s.dy) * seen->jacobian * R_cam_body;
    Vector6d row;  // derivative of the distance by the pose
    row.head<3>() = -(A * R_body_map).transpose();
    row.tail<3>() = -(view.T_body_cam * seen->x_cam).cross(A.transpose());
    out.H += w * row * row.transpose();
    out.b -= w * s.distance * row;
  }
  out.H.diagonal() *= 1 + 1e-6;  // a direction that neither prior nor contours hold
  return out;
}

/// Poses of the prior, each with its score. The prior itself is the first.
std::vector<PoseGuess> draw_guesses(const PosePrior& prior, GuessScorer& scorer) {
  const Matrix6d root = prior.covariance.llt().matrixL();
  std::vector<PoseGuess> guesses{scorer.turned(prior.T_map_body)};
  for (std::size_t i = 1; i < kGuesses; ++i) {
    Pose T_map_body = prior.T_map_body.plus(root * standard_normal(scorer.random()));
    if (!prior.attitudes.empty() && i % kByPrior != 0)
      T_map_body.q = prior.attitudes[i % prior.attitudes.size()] *
                     so3::exp(prior.attitude_sigma_rad * standard_normal(scorer.random()).head<3>());
    guesses.push_back(scorer.turned(T_map_body));
  }
  return guesses;
}

/// A guess, and where it sees some of the points: guesses are alike that see them alike, however a turn makes
/// up for a shift.
struct SeenGuess : PoseGuess {
  std::array<Eigen::Vector2d, kSeenPoints> pixels;
};

/// As keep_different() of poses that see the points `apart_px` apart, root mean square.
void keep_seen_differently(std::vector<PoseGuess>& guesses, std::size_t most, double apart_px,
                           const SearchView& view) {
  std::vector<SeenGuess> seen(guesses.size());
  for (std::size_t i = 0; i < guesses.size(); ++i) {
    static_cast<PoseGuess&>(seen[i]) = guesses[i];
    const Pose T_cam_map = (guesses[i].T_map_body * view.T_body_cam).inverse();
    for (std::size_t k = 0; k < kSeenPoints; ++k) {
      const Eigen::Vector3d x = T_cam_map * view.points[k * view.points.size() / kSeenPoints].position;
      seen[i].pixels[k] = view.camera.focal_px() * x.head<2>() / std::max(x.z(), kNearest_m);
    }
  }
  keep_different(seen, most, [apart_px](const SeenGuess& a, const SeenGuess& b) {
    double sum = 0;
    for (std::size_t k = 0; k < kSeenPoints; ++k) sum += (a.pixels[k] - b.pixels[k]).squaredNorm();
    return sum < kSeenPoints * apart_px * apart_px;
  });
  guesses.assign(seen.begin(), seen.end());
}

/// So many of the points, evenly.
std::vector<SearchPoint> thinned(std::span<const SearchPoint> points, std::size_t most) {
  const std::size_t step = std::max<std::size_t>(1, points.size() / most);
  std::vector<SearchPoint> out;
  for (std::size_t i = 0; i < points.size(); i += step) out.push_back(points[i]);
  return out;
}

}  // namespace

double refine_reach_px() { return 2 * static_cast<double>(EdgeField::spread_px(EdgeSpread::coarse)); }

double score_pose(const SearchView& view, const Pose& T_map_body, EdgeSpread spread) {
  const Projector project(view, T_map_body);
  const auto share = static_cast<float>(kSeenShare);
  double sum = 0;
  for (const SearchPoint& point : view.points) {
    const std::optional<Projection> seen = project(point);
    sum += seen ? std::log(1 - share +
                           share * view.field.likelihood_ratio(seen->pixel.x(), seen->pixel.y(),
                                                               seen->direction, spread))
                : kOutsideScore;
  }
  return view.points.empty() ? 0 : sum / static_cast<double>(view.points.size());
}

PoseGuess refine_pose(const SearchView& view, const Pose& from, const Matrix6d& prior_information,
                      double from_px) {
  Pose pose = from;
  for (double width_px = from_px; width_px >= kNarrowest_px; width_px *= kNarrowing)
    for (int iteration = 0; iteration < kIterations; ++iteration) {
      const NormalEquations equations = linearise(view, pose, from, prior_information, width_px);
      const Vector6d step = equations.H.ldlt().solve(equations.b);
      if (!step.allFinite()) break;
      pose = pose.plus(step);
      if (image_motion_px(step, view.camera.focal_px()) < kConverged * width_px) break;
    }
  return {pose, score_pose(view, pose, EdgeSpread::fine)};
}

std::vector<PoseGuess> search_pose(const SearchView& view, const PosePrior& prior, unsigned seed) {
  if (view.points.empty()) return {};
  GuessScorer scorer(view, prior.T_map_body.p, seed);
  std::vector<PoseGuess> guesses = draw_guesses(prior, scorer);
  const PoseGuess first = guesses.front();
  keep_seen_differently(guesses, kRefined, kApart_px, view);
  guesses.push_back(first);
  const Matrix6d information = prior.covariance.ldlt().solve(Matrix6d::Identity());
  const double evidence = static_cast<double>(view.points.size()) / kCorrelatedPoints;
  const std::vector<SearchPoint> some = thinned(view.points, kRefinedPoints);
  const SearchView coarse{view.field, view.camera, view.T_body_cam, some};
  const auto refine = [&](const SearchView& seen, double steps_px, double from_px) {
    for (PoseGuess& g : guesses) {
      scorer.improve(g, steps_px);
      g = refine_pose(seen, g.T_map_body, information, from_px);
      const Vector6d off = g.T_map_body.minus(prior.T_map_body);
      g.score -= 0.5 * off.dot(information * off) / evidence;
    }
    keep_seen_differently(guesses, kKept, kDifferent_px, view);
  };
  refine(coarse, kFirstSteps_px, kFirstReach_px);
  refine(view, kSecondSteps_px, kLastReach_px);
  return guesses;
}

}  // namespace evpose
