// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_build/boundaries.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace evpose::map_build {
namespace {

constexpr double kMovedByBlur = 0.3;

double density_of(double x) { return std::exp(-0.5 * x * x) / std::sqrt(2 * std::numbers::pi); }
double share_above(double x) { return 0.5 * std::erfc(x / std::numbers::sqrt2); }

struct Step {
  double place, slope, blur, inside, outside;  // densities per square metre
  double at(double t, double d) const {
    return inside * share_above((d - place - slope * t) / blur) + outside;
  }
};

/// Log likelihood but for constants; the integral of the density over the strip in closed form for a small
/// slope, whose first order cancels.
double log_likelihood(std::span<const Eigen::Vector2d> points, const Step& step, double half_length,
                      double half_width) {
  double sum = 0;
  for (const auto& p : points) sum += std::log(step.at(p.x(), p.y()));
  return sum - 2 * half_length * (step.inside * (step.place + half_width) + step.outside * 2 * half_width);
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
    Eigen::Vector3d gradient(-2 * half_length * step.inside, 0,
                             -2 * half_length * (step.place + half_width) * step.inside);
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
  return out;
}

namespace {

double side_of_the_rest(const SurfacePoints& surface, const FittedPlane& plane);

class BoundaryFinder {
 public:
  BoundaryFinder(const SurfacePoints& surface, const Neighbours& tree, const FittedPlane& plane,
                 const Outline& outline, const std::vector<Piece>& creases, const BoundaryConfig& config)
      : surface_(surface),
        tree_(tree),
        plane_(plane),
        frame_(plane),
        outline_(outline),
        creases_(creases),
        config_(config) {
    for (const std::uint32_t i : plane.points) add_point(surface.position[i].cast<double>());
    free_side_ = side_of_the_rest(surface, plane);
  }

  Boundaries find(std::int32_t number) const;

 private:
  void add_point(const Eigen::Vector3d& x) {
    flat_.push_back(frame_.flat(x));
    height_.push_back(plane_.distance(x));
  }
  std::vector<Eigen::Vector2d> own_points(const Eigen::Vector2d& middle, const Eigen::Vector2d& along,
                                          const Eigen::Vector2d& out, double half_length,
                                          double half_width) const;
  bool explained(const Eigen::Vector2d& a, const Eigen::Vector2d& b) const;
  bool goes_on(const Piece& piece) const;
  bool covered(const Piece& piece) const;
  bool fit(const Eigen::Vector2d& a, const Eigen::Vector2d& b, Piece& piece) const;

  const SurfacePoints& surface_;
  const Neighbours& tree_;
  const FittedPlane& plane_;
  PlaneFrame frame_;
  const Outline& outline_;
  const std::vector<Piece>& creases_;
  const BoundaryConfig& config_;
  std::vector<Eigen::Vector2d> flat_;
  std::vector<double> height_;  ///< of the same points over the plane
  double free_side_ = 0;
};

/// Half or more of the side lies along a crease.
bool BoundaryFinder::explained(const Eigen::Vector2d& a, const Eigen::Vector2d& b) const {
  const double reach = 1.5 * outline_.cell_m + 2 * surface_.scale.noise_m;
  constexpr int kProbes = 8;
  int near = 0;
  for (int k = 0; k < kProbes; ++k) {
    const Eigen::Vector3d x = frame_.lift(a + (b - a) * ((k + 0.5) / kProbes));
    near += std::any_of(creases_.begin(), creases_.end(),
                        [&](const Piece& piece) { return distance(piece, x) < reach; })
                ? 1
                : 0;
  }
  return near >= kProbes / 2;
}

/// Points in the plane beyond the edge: it is none, only a change of density or of the plane's number.
bool BoundaryFinder::goes_on(const Piece& piece) const {
  constexpr int kProbes = 12;
  int hit = 0;
  std::uint32_t index = 0;
  float square = 0;
  const double reach = std::max(2.5 * plane_.spacing_m, 2 * surface_.scale.noise_m);
  for (int k = 0; k < kProbes; ++k) {
    const Eigen::Vector3d x =
        piece.begin + (piece.end - piece.begin) * ((k + 0.5) / kProbes) + 1.6 * reach * piece.normal_a;
    if (tree_.nearest(x.cast<float>(), {&index, 1}, {&square, 1}) == 1 &&
        std::sqrt(static_cast<double>(square)) < reach)
      ++hit;
  }
  return hit > kProbes / 2;
}

/// Something stands before the plane beyond the edge, on the side that the plane was seen from: the surface
/// is not over there, it is merely hidden. Only told of planes that have nearly everything on one side, like
/// walls.
bool BoundaryFinder::covered(const Piece& piece) const {
  if (free_side_ == 0) return false;
  constexpr int kProbes = 8, kHeights = 6;
  constexpr double kHighest_m = 0.45;
  int hit = 0;
  std::uint32_t index = 0;
  float square = 0;
  const double reach = std::max(2 * plane_.spacing_m, 0.04), lowest = 2 * reach;
  for (int k = 0; k < kProbes; ++k) {
    const Eigen::Vector3d beyond =
        piece.begin + (piece.end - piece.begin) * ((k + 0.5) / kProbes) + 1.5 * reach * piece.normal_a;
    for (int h = 0; h < kHeights; ++h) {
      const Eigen::Vector3d x =
          beyond + free_side_ * (lowest + (kHighest_m - lowest) * h / (kHeights - 1)) * plane_.normal;
      if (tree_.nearest(x.cast<float>(), {&index, 1}, {&square, 1}) == 1 &&
          std::sqrt(static_cast<double>(square)) < reach) {
        ++hit;
        break;
      }
    }
  }
  return hit > kProbes / 2;
}

/// Side of the plane that nearly all other points of the cloud lie on; 0 if there is none.
double side_of_the_rest(const SurfacePoints& surface, const FittedPlane& plane) {
  constexpr double kAway_m = 0.1, kNearlyAll = 0.9;
  double above = 0, below = 0;
  const std::size_t step = std::max<std::size_t>(1, surface.size() / 4000);
  for (std::size_t i = 0; i < surface.size(); i += step) {
    const double d = plane.distance(surface.position[i].cast<double>());
    above += d > kAway_m ? 1 : 0;
    below += d < -kAway_m ? 1 : 0;
  }
  if (above > kNearlyAll * (above + below)) return 1;
  return below > kNearlyAll * (above + below) ? -1 : 0;
}

/// Points of the plane in a strip around an edge, in its coordinates. A face that hangs from the edge lies on
/// one side of the plane, and its points near the edge pass for the plane's; those on the other side are the
/// plane's own.
std::vector<Eigen::Vector2d> BoundaryFinder::own_points(const Eigen::Vector2d& middle,
                                                        const Eigen::Vector2d& along,
                                                        const Eigen::Vector2d& out, double half_length,
                                                        double half_width) const {
  std::vector<Eigen::Vector2d> all, half[2];
  double at_edge[2] = {0, 0}, within[2] = {0, 0};
  for (std::size_t k = 0; k < flat_.size(); ++k) {
    const Eigen::Vector2d local(along.dot(flat_[k] - middle), out.dot(flat_[k] - middle));
    if (std::abs(local.x()) > half_length || std::abs(local.y()) > half_width) continue;
    const int side = height_[k] > 0 ? 1 : 0;
    all.push_back(local);
    half[side].push_back(local);
    (local.y() > -surface_.scale.noise_m ? at_edge : within)[side] += 1;
  }
  // Both halves, unless one has more at the edge than chance gives it beside the other.
  const double expected = within[0] + within[1] > 0 ? within[1] / (within[0] + within[1]) : 0.5;
  const double edge = at_edge[0] + at_edge[1];
  const double sigma = std::sqrt(std::max(edge * expected * (1 - expected), 1.0));
  const double excess = at_edge[1] - edge * expected;
  if (std::abs(excess) < 2 * sigma) return all;
  return half[excess > 0 ? 0 : 1];
}

bool BoundaryFinder::fit(const Eigen::Vector2d& a, const Eigen::Vector2d& b, Piece& piece) const {
  Eigen::Vector2d along = (b - a).normalized(), out(along.y(), -along.x());  // the surface is on the left
  Eigen::Vector2d middle = 0.5 * (a + b);
  const double half_length = 0.5 * (b - a).norm();
  const double half_width = 2.5 * outline_.cell_m;
  StepFit best;
  for (int round = 0; round < 2; ++round) {
    const std::vector<Eigen::Vector2d> strip = own_points(middle, along, out, half_length, half_width);
    // The softness of the edge: that which makes the points likeliest.
    double likeliest = -INFINITY;
    best = StepFit();
    for (const double factor : {0.25, 0.5, 1.0, 2.0, 4.0}) {
      const double blur = factor * std::max(surface_.scale.noise_m, 0.3 * plane_.spacing_m);
      const StepFit step = fit_step(strip, half_length, half_width, blur);
      if (!step.converged) continue;
      double inside = 0;
      for (const auto& p : strip) inside += p.y() < step.place ? 1 : 0;
      const double density = inside / (2 * half_length * (step.place + half_width));
      const double likelihood =
          log_likelihood(strip, {step.place, step.slope, blur, density, std::max(step.rest, 1e-4) * density},
                         half_length, half_width);
      if (likelihood > likeliest) likeliest = likelihood, best = step;
    }
    if (!best.converged) return false;
    middle += best.place * out;
    along = (along + best.slope * out).normalized();
    out = {along.y(), -along.x()};
  }
  const double soft = config_.most_blur_noise * std::max(surface_.scale.noise_m, 0.3 * plane_.spacing_m);
  if (best.blur_m > soft || best.rest > 0.25) return false;
  piece.kind = ContourKind::boundary;
  piece.begin = frame_.lift(middle - half_length * along);
  piece.end = frame_.lift(middle + half_length * along);
  piece.normal_a = out.x() * frame_.first + out.y() * frame_.second;
  const double across = std::hypot(best.sigma_place, 0.5 * half_length * best.sigma_slope);
  // What blurs the edge also moves it, by a part of the blur.
  piece.sigma_m =
      std::hypot(across, kMovedByBlur * best.blur_m, plane_.sigma_at(0.5 * (piece.begin + piece.end)));
  return across <= config_.most_sigma_m;
}

Boundaries BoundaryFinder::find(std::int32_t number) const {
  Boundaries out;
  for (const Ring& ring : outline_.rings) {
    std::vector<Piece> pieces;
    for (std::size_t k = 0; k < ring.corners.size(); ++k) {
      const Eigen::Vector2d &a = ring.corners[k], &b = ring.corners[(k + 1) % ring.corners.size()];
      const double length = (b - a).norm();
      if (explained(a, b)) continue;
      Piece piece;
      piece.plane_a = number;
      const bool edge = length >= std::max(config_.least_length_m, 3 * outline_.cell_m) && fit(a, b, piece) &&
                        !goes_on(piece) && !covered(piece);
      if (!edge) {
        out.shadow_m += length;
        continue;
      }
      out.pieces.push_back(piece);
    }
  }
  return out;
}

}  // namespace

Boundaries find_boundaries(const SurfacePoints& surface, const Neighbours& tree, const FittedPlane& plane,
                           std::int32_t number, const Outline& outline, const std::vector<Piece>& creases,
                           const BoundaryConfig& config) {
  return BoundaryFinder(surface, tree, plane, outline, creases, config).find(number);
}

}  // namespace evpose::map_build
