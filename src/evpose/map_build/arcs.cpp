// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_build/arcs.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

namespace evpose::map_build {
namespace {

constexpr double kOutlier = 3;       // sigma: further off counts no more
constexpr double kMostRadius_m = 3;  // flatter arcs are lines
constexpr double kLeastTurn_rad = 0.8;
constexpr double kMostRms = 0.35;     // cells: of a stretch's corners off their circle
constexpr double kHopelessRms = 0.9;  // cells: from here on a longer stretch will be no arc either
constexpr double kLeastRadiusCells = 3;
constexpr std::size_t kSmoothed = 6;      // steps
constexpr std::size_t kFewestSteps = 12;  // of a stretch

/// Sums for a circle through points by linear least squares (Kasa), points coming and staying.
struct CircleSums {
  Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();

  void add(const Eigen::Vector2d& p, double weight) {
    const Eigen::Vector3d row(p.x(), p.y(), 1);
    squares += weight * row * row.transpose();
    right += weight * p.squaredNorm() * row;
  }
  std::optional<Circle> circle() const {
    const Eigen::LDLT<Eigen::Matrix3d> solver(squares);
    const Eigen::Vector3d s = solver.solve(right);
    if (solver.info() != Eigen::Success || !s.allFinite()) return {};
    Circle out;
    out.centre = 0.5 * s.head<2>();
    const double square = s[2] + out.centre.squaredNorm();
    if (!(square > 0)) return {};
    out.radius_m = std::sqrt(square);
    return out;
  }
};

/// Log likelihood but for constants, of a distance in units of its error.
double log_likelihood(double off) { return -0.5 * std::min(off * off, kOutlier * kOutlier); }

/// Best of the straight lines through some places.
double on_a_line(const std::vector<CurvePlace>& places) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  Eigen::Matrix2d squares = Eigen::Matrix2d::Zero();
  double weight = 0;
  for (const auto& [p, sigma] : places) {
    const double w = 1 / (sigma * sigma);
    sum += w * p, squares += w * p * p.transpose(), weight += w;
  }
  const Eigen::Vector2d middle = sum / weight;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(squares / weight - middle * middle.transpose());
  double out = 0;
  for (const auto& [p, sigma] : places)
    out += log_likelihood(axes.eigenvectors().col(0).dot(p - middle) / sigma);
  return out;
}

}  // namespace

std::optional<Circle> fit_circle(std::span<const CurvePlace> places) {
  if (places.size() < 3) return {};
  // Relative to one of them, for the squares' sake.
  const Eigen::Vector2d origin = places.front().place;
  CircleSums sums;
  for (const auto& [p, sigma] : places) sums.add(p - origin, 1 / (sigma * sigma));
  std::optional<Circle> circle = sums.circle();
  constexpr int kRounds = 10;
  for (int round = 0; circle && round < kRounds; ++round) {
    Eigen::Matrix3d squares = 1e-12 * Eigen::Matrix3d::Identity();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    for (const auto& [p, sigma] : places) {
      const Eigen::Vector2d d = p - origin - circle->centre;
      const double off = (d.norm() - circle->radius_m) / sigma;
      const double weight = 1 / (sigma * sigma) / std::pow(1 + off * off / (kOutlier * kOutlier), 2);
      const Eigen::Vector3d row(d.x() / d.norm(), d.y() / d.norm(), 1);
      squares += weight * row * row.transpose();
      right += weight * (d.norm() - circle->radius_m) * row;
    }
    const Eigen::Vector3d move = squares.ldlt().solve(right);
    if (!move.allFinite() || move.norm() > circle->radius_m) return {};
    circle->centre += move.head<2>();
    circle->radius_m += move.z();
    if (move.norm() < 1e-7) break;
  }
  if (!circle || !(circle->radius_m > 0)) return {};
  circle->centre += origin;
  return circle;
}

double arc_over_lines(std::span<const CurvePlace> places, const Circle& circle, std::span<const int> line_of,
                      std::span<const int> needed_anyway) {
  const double penalty = 0.5 * std::log(static_cast<double>(places.size()));  // of a parameter
  double arc = -3 * penalty, lines = 0;
  std::map<int, std::vector<CurvePlace>> sides;
  for (std::size_t k = 0; k < places.size(); ++k) {
    arc += log_likelihood(circle.distance(places[k].place) / places[k].sigma_m);
    sides[line_of[k]].push_back(places[k]);
  }
  for (const auto& [number, on] : sides) {
    const bool needed = std::find(needed_anyway.begin(), needed_anyway.end(), number) != needed_anyway.end();
    lines += on_a_line(on) - (needed ? 0 : 2 * penalty);
  }
  return arc - lines;
}

std::optional<ArcRun> likeliest_arc(std::span<const CurvePlace> places, std::span<const int> line_of,
                                    std::size_t fewest) {
  constexpr std::size_t kMostEnds = 40;
  const std::size_t n = places.size(), step = 2 * (n / (2 * kMostEnds) + 1);
  std::optional<ArcRun> best;
  for (std::size_t first = 0; first + fewest <= n; first += step)
    for (std::size_t count = n - first; count >= fewest; count -= std::min(step, count)) {
      const auto circle = fit_circle(places.subspan(first, count));
      if (!circle || circle->radius_m > kMostRadius_m) continue;
      std::vector<int> outside(line_of.begin(), line_of.begin() + static_cast<std::ptrdiff_t>(first));
      outside.insert(outside.end(), line_of.begin() + static_cast<std::ptrdiff_t>(first + count),
                     line_of.end());
      const double gain =
          arc_over_lines(places.subspan(first, count), *circle, line_of.subspan(first, count), outside);
      if (gain > (best ? best->gain : 0)) best = ArcRun{first, count, *circle, gain};
    }
  return best;
}

std::vector<ArcStretch> find_arcs(const std::vector<Eigen::Vector2d>& ring, double cell_m,
                                  double least_length_m) {
  const std::size_t n = ring.size();
  // Middles of some steps lie nearer to the line than the ring's corners do.
  std::vector<Eigen::Vector2d> middle(n, Eigen::Vector2d::Zero());
  for (std::size_t k = 0; k < n; ++k)
    for (std::size_t j = 0; j < kSmoothed; ++j)
      middle[(k + kSmoothed / 2) % n] += ring[(k + j) % n] / kSmoothed;
  const std::size_t fewest = std::max(static_cast<std::size_t>(least_length_m / cell_m), kFewestSteps);
  struct Found {
    double turn;
    ArcStretch stretch;
  };
  std::vector<Found> found;
  const std::size_t stride = 2;
  for (std::size_t first = 0; first < n && n >= fewest; first += stride) {
    CircleSums sums;
    Found best{0, {}};
    for (std::size_t count = 1; count <= n; ++count) {
      sums.add(middle[(first + count - 1) % n] - middle[first], 1);
      if (count < fewest || count % 4 != 0) continue;
      std::optional<Circle> circle = sums.circle();
      if (!circle || (circle->radius_m > kMostRadius_m && count > kFewestSteps + 30)) break;
      circle->centre += middle[first];
      double squares = 0, turn = 0;
      for (std::size_t k = 0; k < count; ++k) {
        const Eigen::Vector2d a = middle[(first + k) % n] - circle->centre;
        squares += std::pow(a.norm() - circle->radius_m, 2);
        if (k + 1 == count) continue;
        const Eigen::Vector2d b = middle[(first + k + 1) % n] - circle->centre;
        turn += std::atan2(a.x() * b.y() - a.y() * b.x(), a.dot(b));
      }
      const double rms = std::sqrt(squares / static_cast<double>(count)) / cell_m;
      if (rms > kHopelessRms) break;
      const bool is_arc = rms <= kMostRms && circle->radius_m >= kLeastRadiusCells * cell_m &&
                          circle->radius_m <= kMostRadius_m;
      if (is_arc && std::abs(turn) > best.turn) best = {std::abs(turn), {first, count, *circle}};
      if (std::abs(turn) > 1.9 * std::numbers::pi) break;
    }
    if (best.turn >= kLeastTurn_rad) found.push_back(best);
  }
  std::stable_sort(found.begin(), found.end(),
                   [](const Found& a, const Found& b) { return a.turn > b.turn; });
  std::vector<ArcStretch> out;
  std::vector<bool> taken(n, false);
  for (const auto& [turn, stretch] : found) {
    // What longer turns have left of it.
    ArcStretch longest;
    for (std::size_t k = 0; k < stretch.count;) {
      std::size_t end = k;
      while (end < stretch.count && !taken[(stretch.first + end) % n]) ++end;
      if (end - k > longest.count) longest = {(stretch.first + k) % n, end - k, stretch.circle};
      k = end + 1;
    }
    if (longest.count < fewest) continue;
    for (std::size_t k = 0; k < longest.count; ++k) taken[(longest.first + k) % n] = true;
    out.push_back(longest);
  }
  return out;
}

}  // namespace evpose::map_build
