// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_learn/line_detector.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace evpose::map_learn {
namespace {

constexpr double kSameDirection = 0.96;  // cosine between cells of one line
constexpr double kOffLine_cells = 1.0;   // largest distance of a ridge cell from its line
constexpr double kSideBySide = 0.9;      // cosine between lines that run side by side
constexpr int kBeside_cells = 4;         // where the level beside a ridge is read

/// A cell through which a ridge runs.
struct Ridge {
  int x, y;
  Eigen::Vector2d point, normal;  ///< on the ridge, cells; across it, unit
  double contrast, significance;
};

std::vector<float> blurred(const CountImage& image, double sigma) {
  const int r = static_cast<int>(std::ceil(3 * sigma));
  std::vector<float> kernel;
  float sum = 0;
  for (int k = -r; k <= r; ++k)
    sum += kernel.emplace_back(std::exp(-0.5F * static_cast<float>(k * k / (sigma * sigma))));
  for (float& k : kernel) k /= sum;
  const auto pass = [&](const std::vector<float>& from, int dx, int dy) {
    std::vector<float> to(from.size(), 0);
    for (int y = 0; y < image.height; ++y)
      for (int x = 0; x < image.width; ++x) {
        float v = 0;
        for (int k = -r; k <= r; ++k) {
          const int u = x + k * dx, w = y + k * dy;
          if (u < 0 || w < 0 || u >= image.width || w >= image.height) continue;
          v += kernel[static_cast<std::size_t>(k + r)] *
               from[static_cast<std::size_t>(w) * static_cast<std::size_t>(image.width) +
                    static_cast<std::size_t>(u)];
        }
        to[static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width) +
           static_cast<std::size_t>(x)] = v;
      }
    return to;
  };
  return pass(pass(image.counts, 1, 0), 0, 1);
}

class Detector {
 public:
  Detector(const CountImage& image, const LineDetectorConfig& config)
      : config_(config), smooth_{image.width, image.height, blurred(image, config.blur_cells)} {}

  std::vector<RidgeLine> detect(double apart_cells);

 private:
  void find_ridges();
  void add_ridge(int x, int y);
  void grow(std::size_t seed, std::vector<std::size_t>& line);
  void fit(const std::vector<std::size_t>& line);

  LineDetectorConfig config_;
  CountImage smooth_;
  std::vector<Ridge> ridges_;
  std::vector<std::int32_t> ridge_at_;
  std::vector<bool> taken_;
  std::vector<RidgeLine> lines_;
};

void Detector::find_ridges() {
  ridge_at_.assign(smooth_.counts.size(), -1);
  for (int y = kBeside_cells + 1; y + kBeside_cells + 1 < smooth_.height; ++y)
    for (int x = kBeside_cells + 1; x + kBeside_cells + 1 < smooth_.width; ++x)
      if (smooth_.at(x, y) > 0) add_ridge(x, y);
}

/// If a ridge runs through the cell: where the slope across it, by its second derivatives, is zero.
void Detector::add_ridge(int x, int y) {
  const auto s = [&](int dx, int dy) { return static_cast<double>(smooth_.at(x + dx, y + dy)); };
  const double xx = s(1, 0) - 2 * s(0, 0) + s(-1, 0), yy = s(0, 1) - 2 * s(0, 0) + s(0, -1);
  const double xy = 0.25 * (s(1, 1) - s(1, -1) - s(-1, 1) + s(-1, -1));
  const Eigen::Vector2d slope(0.5 * (s(1, 0) - s(-1, 0)), 0.5 * (s(0, 1) - s(0, -1)));
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen;
  eigen.computeDirect((Eigen::Matrix2d() << xx, xy, xy, yy).finished());
  const double curvature = eigen.eigenvalues()(0);
  if (!(curvature < 0) || std::abs(eigen.eigenvalues()(1)) > -curvature) return;
  const Eigen::Vector2d n = eigen.eigenvectors().col(0);
  const Eigen::Vector2d shift = -slope.dot(n) / curvature * n;
  if (shift.cwiseAbs().maxCoeff() > 0.6) return;
  const auto beside = [&](int side) {
    return s(static_cast<int>(std::lround(side * kBeside_cells * n.x())),
             static_cast<int>(std::lround(side * kBeside_cells * n.y())));
  };
  const double level = 0.5 * (beside(1) + beside(-1)), peak = s(0, 0), contrast = peak - level;
  // A blurred cell is a mean over 4 pi blur^2 cells.
  const double cells = 4 * std::numbers::pi * config_.blur_cells * config_.blur_cells;
  const double significance = contrast / std::sqrt(std::max(peak, 1 / cells) / cells);
  if (contrast < config_.least_contrast * peak || significance < config_.least_significance) return;
  ridge_at_[static_cast<std::size_t>(y) * static_cast<std::size_t>(smooth_.width) +
            static_cast<std::size_t>(x)] = static_cast<std::int32_t>(ridges_.size());
  ridges_.push_back({x, y, Eigen::Vector2d(x, y) + shift, n, contrast, significance});
}

/// From the seed to its neighbours of the same direction, as long as they lie on the seed's line.
void Detector::grow(std::size_t seed, std::vector<std::size_t>& line) {
  const Ridge& first = ridges_[seed];
  line = {seed};
  taken_[seed] = true;
  for (std::size_t k = 0; k < line.size(); ++k) {
    const Ridge here = ridges_[line[k]];
    for (int dy = -2; dy <= 2; ++dy)
      for (int dx = -2; dx <= 2; ++dx) {
        const int x = here.x + dx, y = here.y + dy;
        if (x < 0 || y < 0 || x >= smooth_.width || y >= smooth_.height) continue;
        const std::int32_t other =
            ridge_at_[static_cast<std::size_t>(y) * static_cast<std::size_t>(smooth_.width) +
                      static_cast<std::size_t>(x)];
        if (other < 0 || taken_[static_cast<std::size_t>(other)]) continue;
        const Ridge& r = ridges_[static_cast<std::size_t>(other)];
        const Eigen::Vector2d way = r.point - first.point;
        if (std::abs(r.normal.dot(first.normal)) < kSameDirection ||
            std::abs(way.dot(first.normal)) > kOffLine_cells || way.norm() > 0.5 * config_.most_length)
          continue;
        taken_[static_cast<std::size_t>(other)] = true;
        line.push_back(static_cast<std::size_t>(other));
      }
  }
}

void Detector::fit(const std::vector<std::size_t>& line) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  double sum = 0, contrast = 0, square = 0;
  for (const std::size_t i : line) {
    const Ridge& r = ridges_[i];
    mean += r.contrast * r.point;
    sum += r.contrast;
    square += r.significance * r.significance;
  }
  mean /= sum;
  contrast = sum / static_cast<double>(line.size());
  Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero();
  for (const std::size_t i : line) {
    const Eigen::Vector2d d = ridges_[i].point - mean;
    scatter += ridges_[i].contrast / sum * d * d.transpose();
  }
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen;
  eigen.computeDirect(scatter);
  constexpr double kStraight_cells = 0.5;  // RMS across the line
  if (std::sqrt(std::max(0.0, eigen.eigenvalues()(0))) > kStraight_cells) return;
  const Eigen::Vector2d along = eigen.eigenvectors().col(1);
  double low = 0, high = 0;
  for (const std::size_t i : line) {
    const double t = along.dot(ridges_[i].point - mean);
    low = std::min(low, t), high = std::max(high, t);
  }
  if (high - low < config_.least_length || static_cast<double>(line.size()) < 0.7 * (high - low)) return;
  lines_.push_back({mean + low * along, mean + high * along, contrast, std::sqrt(square)});
}

bool run_side_by_side(const RidgeLine& a, const RidgeLine& b, double apart) {
  const Eigen::Vector2d da = (a.b - a.a).normalized(), db = (b.b - b.a).normalized();
  if (std::abs(da.dot(db)) < kSideBySide) return false;
  const Eigen::Vector2d middle = 0.5 * (b.a + b.b) - a.a;
  const double along = middle.dot(da), across = std::abs(da.x() * middle.y() - da.y() * middle.x());
  const double reach = 0.5 * (b.b - b.a).norm();
  return across < apart && along > -reach && along < (a.b - a.a).norm() + reach;
}

std::vector<RidgeLine> Detector::detect(double apart_cells) {
  find_ridges();
  taken_.assign(ridges_.size(), false);
  std::vector<std::size_t> order(ridges_.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return ridges_[a].significance > ridges_[b].significance;
  });
  std::vector<std::size_t> line;
  for (const std::size_t seed : order) {
    if (taken_[seed]) continue;
    grow(seed, line);
    fit(line);
  }
  std::stable_sort(lines_.begin(), lines_.end(),
                   [](const RidgeLine& a, const RidgeLine& b) { return a.significance > b.significance; });
  std::vector<RidgeLine> kept;
  for (const RidgeLine& l : lines_)
    if (std::none_of(kept.begin(), kept.end(),
                     [&](const RidgeLine& k) { return run_side_by_side(k, l, apart_cells); }))
      kept.push_back(l);
  return kept;
}

}  // namespace

std::vector<RidgeLine> detect_lines(const CountImage& image, const LineDetectorConfig& config,
                                    double apart_cells) {
  return Detector(image, config).detect(apart_cells);
}

}  // namespace evpose::map_learn
