// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/relocalization/attitude_search.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <tuple>

#include "evpose/core/keep_different.h"
#include "evpose/core/pose.h"

namespace evpose {
namespace {

// Directions of the map.
constexpr std::size_t kMostDirections = 6;
constexpr double kLeastShare = 0.03;
constexpr double kSameDirection_cos = 0.9962;   // 5 deg
constexpr double kTakenDirection_cos = 0.9781;  // 12 deg
constexpr double kBinsPerUnit = 20;             // of tangents
constexpr int kMeanShifts = 3;

// Attitudes.
constexpr double kEnd_px = 0.5;          // error of a line's ends, 1 sigma
constexpr double kCurved_rad = 0.003;    // lens and motion bend lines, and maps' directions scatter
constexpr double kOfMap = 0.6;           // share of lines along one of the map's directions
constexpr double kStep_rad = 0.07;       // of the grid of attitudes
constexpr double kTilt_rad = 0.35;       // that acceleration may feign
constexpr double kTiltSigma_rad = 0.17;  // and usually does
constexpr std::size_t kRefined = 60;
constexpr int kIterations = 12;
constexpr double kDifferent_rad = 0.05;
constexpr std::size_t kMostLines = 120;

/// A line as it constrains directions: these are perpendicular to its plane through the eye.
struct LinePlane {
  Eigen::Vector3d normal;  ///< unit, body frame
  double sigma;            ///< rad
};

std::vector<LinePlane> planes_of(std::span<const EdgeLine> lines, const Camera& camera,
                                 const Eigen::Quaterniond& q_body_cam) {
  std::vector<std::pair<double, LinePlane>> by_length;
  for (const EdgeLine& line : lines) {
    const auto a = camera.unproject(line.from), b = camera.unproject(line.to);
    if (!a || !b) continue;
    const Eigen::Vector3d n = a->cross(*b);
    const double angle = n.norm(), length_px = (line.to - line.from).norm();
    if (!(angle > 0)) continue;
    by_length.push_back(
        {length_px, {q_body_cam * (n / angle), std::hypot(2 * kEnd_px / length_px, kCurved_rad)}});
  }
  std::stable_sort(by_length.begin(), by_length.end(),
                   [](const auto& a, const auto& b) { return a.first > b.first; });
  std::vector<LinePlane> out;
  for (const auto& [length, plane] : by_length)
    if (out.size() < kMostLines) out.push_back(plane);
  return out;
}

class AttitudeScore {
 public:
  AttitudeScore(std::span<const LinePlane> planes, std::span<const MapDirection> directions,
                const AttitudePrior& prior)
      : planes_(planes), directions_(directions), prior_(prior) {
    double sum = 0;
    for (const MapDirection& d : directions) sum += d.share;
    for (const MapDirection& d : directions) shares_.push_back(d.share / sum);
  }

  /// `blur`: added to each line's sigma, rad.
  double operator()(const Eigen::Quaterniond& q_map_body, double blur) const {
    const Eigen::Matrix3d R = q_map_body.conjugate().toRotationMatrix();
    std::array<Eigen::Vector3d, kMostDirections> d;
    for (std::size_t k = 0; k < directions_.size(); ++k) d[k] = R * directions_[k].axis;
    double sum = 0;
    for (const LinePlane& plane : planes_) {
      const double sigma = std::hypot(plane.sigma, blur);
      double likelihood = 0;
      for (std::size_t k = 0; k < directions_.size(); ++k) {
        const double x = plane.normal.dot(d[k]) / sigma;
        // The normal distribution, cut off at three sigma.
        if (x * x < 9) likelihood += shares_[k] * std::exp(-0.5 * x * x);
      }
      // At random the product with the normal is uniform in -1 .. 1.
      sum += std::log(1 - kOfMap + kOfMap * likelihood * 0.798 / sigma);
    }
    const double tilt = std::acos(std::clamp((q_map_body * prior_.up_body).z(), -1.0, 1.0));
    return sum - 0.5 * std::pow(tilt / kTiltSigma_rad, 2);
  }

  /// To the optimum near by.
  Eigen::Quaterniond refined(Eigen::Quaterniond q) const {
    double blur = kStep_rad / 2;
    for (int i = 0; i < kIterations; ++i, blur *= 0.7) {
      Eigen::Matrix3d H = Eigen::Matrix3d::Identity() * 1e-6;
      Eigen::Vector3d b = Eigen::Vector3d::Zero();
      const Eigen::Matrix3d R = q.conjugate().toRotationMatrix();
      for (const LinePlane& plane : planes_) {
        const double sigma = std::hypot(plane.sigma, blur);
        for (std::size_t k = 0; k < directions_.size(); ++k) {
          const Eigen::Vector3d d = R * directions_[k].axis;
          const double x = plane.normal.dot(d);
          if (std::abs(x) > 3 * sigma) continue;
          // q Exp(phi): d changes by d x phi.
          const double w = std::exp(-0.5 * x * x / (sigma * sigma)) / (sigma * sigma);
          const Eigen::Vector3d row = plane.normal.cross(d);
          H += w * row * row.transpose();
          b -= w * x * row;
        }
      }
      // Gravity holds little.
      const Eigen::Vector3d up = R * Eigen::Vector3d::UnitZ();
      const Eigen::Vector3d turn = up.cross(prior_.up_body);  // that takes up to up_body
      H += (Eigen::Matrix3d::Identity() - up * up.transpose()) / (kTiltSigma_rad * kTiltSigma_rad);
      b -= turn / (kTiltSigma_rad * kTiltSigma_rad);
      const Eigen::Vector3d step = H.ldlt().solve(b);
      if (!step.allFinite() || step.norm() > 0.5) break;
      q = (q * so3::exp(step)).normalized();
    }
    return q;
  }

 private:
  std::span<const LinePlane> planes_;
  std::span<const MapDirection> directions_;
  const AttitudePrior& prior_;
  std::vector<double> shares_;
};

/// Angle about the map's z between two attitudes, 0 .. pi.
double heading_between(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) {
  const Eigen::Quaterniond d = a * b.conjugate();
  return 2 * std::abs(std::atan2(d.z(), d.w()) - (d.w() < 0 ? std::copysign(std::numbers::pi, d.z()) : 0));
}

std::vector<AttitudeGuess> grid(const AttitudeScore& score, const AttitudePrior& prior) {
  const Eigen::Quaterniond level =
      Eigen::Quaterniond::FromTwoVectors(prior.up_body, Eigen::Vector3d::UnitZ());
  const int turns = static_cast<int>(std::ceil(2 * std::numbers::pi / kStep_rad)),
            tilts = static_cast<int>(kTilt_rad / kStep_rad);
  std::vector<AttitudeGuess> out;
  for (int turn = 0; turn < turns; ++turn)
    for (int i = -tilts; i <= tilts; ++i)
      for (int j = -tilts; j <= tilts; ++j) {
        if (i * i + j * j > tilts * tilts) continue;
        const Eigen::Quaterniond q = so3::exp(Eigen::Vector3d(0, 0, 2 * std::numbers::pi * turn / turns)) *
                                     so3::exp(Eigen::Vector3d(i * kStep_rad, j * kStep_rad, 0)) * level;
        if (heading_between(q, prior.heading_from) > prior.heading_within + kStep_rad ||
            q.angularDistance(prior.heading_from) > prior.turned_within + kStep_rad)
          continue;
        out.push_back({q, score(q, kStep_rad / 2)});
      }
  return out;
}

/// Attitudes nearer than this are one.
auto nearer_than(double apart_rad) {
  return [=](const AttitudeGuess& a, const AttitudeGuess& b) {
    return b.q_map_body.angularDistance(a.q_map_body) < apart_rad;
  };
}

}  // namespace

std::vector<MapDirection> main_directions(const ContourMap& map) {
  struct Bin {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    double length = 0;
  };
  std::map<std::tuple<int, int, int>, Bin> by_bin;
  double total = 0;
  for (const ContourPoint& p : map.points) {
    if (is_view_dependent(p.kind)) continue;
    Eigen::Vector3d t = p.tangent.cast<double>();
    // One of the two signs, the same for all near by.
    int largest = 0;
    t.cwiseAbs().maxCoeff(&largest);
    if (t[largest] < 0) t = -t;
    const double length = p.length > 0 ? p.length : 0.01;
    const auto bin = [&](int k) { return static_cast<int>(std::floor(t[k] * kBinsPerUnit + 0.5)); };
    Bin& b = by_bin[{bin(0), bin(1), bin(2)}];
    b.sum += length * t;
    b.length += length;
    total += length;
  }
  std::vector<Bin> bins;
  for (const auto& [key, bin] : by_bin)
    if (bin.sum.norm() > 0) bins.push_back({bin.sum.normalized(), bin.length});
  std::vector<MapDirection> out;
  while (out.size() < kMostDirections && !bins.empty()) {
    const auto within = [&](const Eigen::Vector3d& axis, double cosine) {
      Bin near;
      for (const Bin& b : bins)
        if (const double c = b.sum.dot(axis); std::abs(c) > cosine)
          near.sum += (c < 0 ? -b.length : b.length) * b.sum, near.length += b.length;
      return near;
    };
    MapDirection best{Eigen::Vector3d::UnitZ(), 0};
    for (const Bin& b : bins)
      if (const double length = within(b.sum, kSameDirection_cos).length; length > best.share)
        best = {b.sum, length};
    for (int i = 0; i < kMeanShifts; ++i) {
      const Bin near = within(best.axis, kSameDirection_cos);
      best = {near.sum.normalized(), near.length};
    }
    if (!(best.share > kLeastShare * total)) break;
    best.share /= total;
    out.push_back(best);
    std::erase_if(bins, [&](const Bin& b) { return std::abs(b.sum.dot(best.axis)) > kTakenDirection_cos; });
  }
  return out;
}

std::vector<AttitudeGuess> search_attitude(std::span<const EdgeLine> lines, const Camera& camera,
                                           const Eigen::Quaterniond& q_body_cam,
                                           std::span<const MapDirection> directions,
                                           const AttitudePrior& prior, std::size_t most) {
  const std::vector<LinePlane> planes = planes_of(lines, camera, q_body_cam);
  if (directions.size() < 2 || planes.empty()) return {};
  const AttitudeScore score(planes, directions, prior);
  std::vector<AttitudeGuess> guesses = grid(score, prior);
  keep_different(guesses, kRefined, nearer_than(kStep_rad));
  for (AttitudeGuess& g : guesses) {
    g.q_map_body = score.refined(g.q_map_body);
    g.score = score(g.q_map_body, 0);
  }
  std::erase_if(guesses, [&](const AttitudeGuess& g) {
    return heading_between(g.q_map_body, prior.heading_from) > prior.heading_within ||
           g.q_map_body.angularDistance(prior.heading_from) > prior.turned_within;
  });
  keep_different(guesses, most, nearer_than(kDifferent_rad));
  return guesses;
}

}  // namespace evpose
