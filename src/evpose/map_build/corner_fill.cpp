// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_build/corner_fill.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>
#include <vector>

namespace evpose::map_build {
namespace {

constexpr double kPrior = 0.3;  // of corners, that something stands in them
constexpr std::array<double, 10> kSizes_m{0.01, 0.015, 0.02, 0.03, 0.04, 0.05, 0.06, 0.08, 0.1, 0.12};
constexpr double kOutside = 3;  // noise: how far behind a face points are looked at
constexpr int kRounds = 8;      // of expectation and maximisation
constexpr std::size_t kMostPoints = 500;

double normal_density(double x) { return std::exp(-0.5 * x * x) / std::sqrt(2 * std::numbers::pi); }
double normal_share(double x) { return 0.5 * std::erfc(-x / std::numbers::sqrt2); }

/// Of the points: shares below a size, and densities about it, in units of the noise.
struct Coordinate {
  std::vector<double> share, density;
  Coordinate(const std::vector<double>& values, double size, double noise) {
    for (const double v : values) {
      share.push_back(normal_share((v - size) / noise));
      density.push_back(normal_density((v - size) / noise) / noise);
    }
  }
};

using Weights = std::array<double, 5>;  // first face, second face, rest, top, front

/// Densities of one component each, of the points.
using Components = std::array<std::vector<double>, 5>;

double log_likelihood_of(const Components& c, const Weights& weight, std::size_t points) {
  double out = 0;
  for (std::size_t i = 0; i < points; ++i) {
    double all = 0;
    for (std::size_t k = 0; k < c.size(); ++k) all += weight[k] * c[k][i];
    out += std::log(all);
  }
  return out;
}

/// Points of both faces, the top and the front of what stands in their corner, and of a rest.
class Corner {
 public:
  Corner(std::span<const Eigen::Vector2d> points, double noise_m, double window_m)
      : noise_(noise_m), window_(window_m) {
    std::vector<const Eigen::Vector2d*> inside;
    for (const Eigen::Vector2d& p : points)
      if (p.minCoeff() > -kOutside * noise_m && p.maxCoeff() < window_m) inside.push_back(&p);
    const std::size_t step = inside.size() / kMostPoints + 1;
    for (std::size_t i = 0; i < inside.size(); i += step) {
      over_first_.push_back(inside[i]->x());
      over_second_.push_back(inside[i]->y());
    }
    for (const double size : kSizes_m)
      if (size >= noise_m && size <= 0.5 * window_m) sizes_.push_back(size);
    first_.emplace_back(over_first_, 0, noise_m);
    second_.emplace_back(over_second_, 0, noise_m);
    for (const double size : sizes_) {
      first_.emplace_back(over_first_, size, noise_m);
      second_.emplace_back(over_second_, size, noise_m);
    }
    first_end_ = Coordinate(over_first_, window_m, noise_m).share;
    second_end_ = Coordinate(over_second_, window_m, noise_m).share;
  }

  std::size_t points() const { return over_first_.size(); }
  const std::vector<double>& sizes() const { return sizes_; }
  /// That nothing stands there, with the weights that suit best.
  double fit_empty() {
    const Components c = components(0, 0);
    weight_ = {1.0 / 3, 1.0 / 3, 1.0 / 3, 0, 0};
    for (int round = 0; round < kRounds; ++round) {
      Weights sum{};
      for (std::size_t i = 0; i < points(); ++i) {
        double all = 0;
        for (std::size_t k = 0; k < 3; ++k) all += weight_[k] * c[k][i];
        for (std::size_t k = 0; k < 3; ++k) sum[k] += weight_[k] * c[k][i] / all;
      }
      for (std::size_t k = 0; k < 3; ++k) weight_[k] = sum[k] / static_cast<double>(points());
    }
    return log_likelihood_of(c, weight_, points());
  }
  /// That something stands there, `width` and `height` numbers of sizes, as dense as the face that each side
  /// is parallel to. A side may be hidden from the scanner: mean over that top, front or neither is.
  double log_likelihood(std::size_t width, std::size_t height) const {
    const Components c = components(width + 1, height + 1);
    const double w = sizes_[width] / window_, h = sizes_[height] / window_;
    std::array<double, 3> values{};
    for (std::size_t hidden = 0; hidden < 3; ++hidden) {
      Weights weight{weight_[0] * (1 - w), weight_[1] * (1 - h), weight_[2], hidden == 1 ? 0 : weight_[0] * w,
                     hidden == 2 ? 0 : weight_[1] * h};
      const double sum = std::accumulate(weight.begin(), weight.end(), 0.0);
      for (double& share : weight) share /= sum;
      values[hidden] = log_likelihood_of(c, weight, points());
    }
    const double most = *std::max_element(values.begin(), values.end());
    double mean = 0;
    for (const double value : values) mean += std::exp(value - most) / static_cast<double>(values.size());
    return most + std::log(mean);
  }

 private:
  /// Numbers of sizes, 0: none.
  Components components(std::size_t width, std::size_t height) const {
    const double w = width > 0 ? sizes_[width - 1] : 0, h = height > 0 ? sizes_[height - 1] : 0;
    const double side = window_ + kOutside * noise_;
    Components c;
    for (auto& component : c) component.assign(points(), 0);
    for (std::size_t i = 0; i < points(); ++i) {
      c[0][i] = first_[0].density[i] * (second_[width].share[i] - second_end_[i]) / (window_ - w);
      c[1][i] = second_[0].density[i] * (first_[height].share[i] - first_end_[i]) / (window_ - h);
      c[2][i] = 1 / (side * side);
      if (width == 0) continue;
      c[3][i] = first_[height].density[i] * (second_[0].share[i] - second_[width].share[i]) / w;
      c[4][i] = second_[width].density[i] * (first_[0].share[i] - first_[height].share[i]) / h;
    }
    return c;
  }

  double noise_, window_;
  Weights weight_{};  ///< of an empty corner
  std::vector<double> over_first_, over_second_, sizes_;
  std::vector<Coordinate> first_, second_;  ///< by number of size
  std::vector<double> first_end_, second_end_;
};

}  // namespace

CornerFill corner_fill(std::span<const Eigen::Vector2d> points, double noise_m, double window_m) {
  Corner corner(points, noise_m, window_m);
  const std::vector<double>& sizes = corner.sizes();
  CornerFill out;
  if (sizes.empty() || corner.points() == 0) return out;
  const double nothing = corner.fit_empty();
  const double prior = kPrior / static_cast<double>(sizes.size() * sizes.size());
  Eigen::ArrayXXd gain(sizes.size(), sizes.size());
  for (std::size_t w = 0; w < sizes.size(); ++w)
    for (std::size_t h = 0; h < sizes.size(); ++h)
      gain(static_cast<Eigen::Index>(w), static_cast<Eigen::Index>(h)) =
          corner.log_likelihood(w, h) - nothing;
  const double most = std::max(0.0, gain.maxCoeff());  // that exponentials stay finite
  double sum = 0;
  Eigen::Array2d mean = Eigen::Array2d::Zero(), squares = Eigen::Array2d::Zero();
  for (std::size_t w = 0; w < sizes.size(); ++w)
    for (std::size_t h = 0; h < sizes.size(); ++h) {
      const double p =
          prior * std::exp(gain(static_cast<Eigen::Index>(w), static_cast<Eigen::Index>(h)) - most);
      const Eigen::Array2d size(sizes[w], sizes[h]);
      sum += p;
      mean += p * size;
      squares += p * size * size;
    }
  const double all = sum + (1 - kPrior) * std::exp(-most);
  out.probability = sum / all;
  if (!(sum > 0)) return out;
  mean /= sum;
  const Eigen::Array2d sigma = (squares / sum - mean * mean).max(0).sqrt();
  out.width_m = mean.x(), out.height_m = mean.y();
  out.sigma_width_m = sigma.x(), out.sigma_height_m = sigma.y();
  return out;
}

}  // namespace evpose::map_build
