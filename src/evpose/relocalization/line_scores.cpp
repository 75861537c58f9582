// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/relocalization/line_scores.h"

#include <algorithm>
#include <cmath>

#include "evpose/core/float_lanes.h"
#include "evpose/registration/coarse_ranking.h"

namespace evpose {
namespace {

using lanes::all;
using lanes::Floats;
using lanes::Ints;
using lanes::kSide;
using lanes::load;

constexpr double kCellsPerSpread = 1.6;  // of the table
constexpr float kSeenShare = 0.3F;       // of the contours in view, motion makes so many visible
constexpr float kOutsideScore = -0.3F;
constexpr float kNearest_m = 0.1F;
constexpr double kBackground = 0.2;  // to each side of a cell the background is averaged over, tangent units
constexpr float kLeastBackground = 0.01F;  // bounds the weight of a lone line
constexpr float kFar_cells = 1e3F;

}  // namespace

void SeenPoints::add(const Eigen::Vector3f& p, const Eigen::Vector3f& t) {
  x_.push_back(p.x());
  y_.push_back(p.y());
  z_.push_back(p.z());
  direction_.push_back(LineScores::direction(t.x() * p.z() - p.x() * t.z(), t.y() * p.z() - p.y() * t.z()));
  ++count_;
}

void SeenPoints::complete() {
  const std::size_t whole = (count_ + kSide - 1) / kSide * kSide;
  x_.resize(whole, 0.0F);
  y_.resize(whole, 0.0F);
  z_.resize(whole, -1e6F);  // behind the camera
  direction_.resize(whole, 0);
}

int LineScores::direction(float x, float y) {
  const float a = std::abs(x), b = std::abs(y);
  const float turn = (x * y >= 0 ? b : 2 * a + b) / std::max(a + b, 1e-12F);  // 0 .. 2
  return static_cast<int>(0.5F * (kDirections * turn + 1)) & (kDirections - 1);
}

LineScores::LineScores(std::span<const EdgeLine> lines, const Camera& camera, double spread)
    : half_view_(evpose::half_view(camera)), cells_per_unit_(static_cast<float>(kCellsPerSpread / spread)) {
  columns_ = 2 * static_cast<int>(std::ceil(half_view_.x() * cells_per_unit_)) + 3;
  rows_ = 2 * static_cast<int>(std::ceil(half_view_.y() * cells_per_unit_)) + 3;
  const auto plane = static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_);
  std::vector<Plane> distances(kDirections, Plane(plane, kFar_cells));
  for (const EdgeLine& line : lines) {
    const auto from = camera.unproject(line.from), to = camera.unproject(line.to);
    if (from && to && from->z() > 0.1 && to->z() > 0.1)
      draw(from->head<2>() / from->z(), to->head<2>() / to->z(), distances);
  }
  scores_.assign(plane * kDirections, kOutsideScore);
  for (int k = 0; k < kDirections; ++k) {
    transform(distances[static_cast<std::size_t>(k)]);
    fill(distances[static_cast<std::size_t>(k)], camera, k, spread);
  }
}

/// Zero in the cells of the line, in its direction and the two beside it.
void LineScores::draw(const Eigen::Vector2d& from, const Eigen::Vector2d& to,
                      std::vector<Plane>& distances) const {
  const Eigen::Vector2d step = to - from;
  const int middle = direction(static_cast<float>(step.x()), static_cast<float>(step.y()));
  const int steps = 1 + static_cast<int>(2 * step.norm() * cells_per_unit_);
  for (int s = 0; s <= steps; ++s) {
    const Eigen::Vector2d at = (from + step * s / steps) * static_cast<double>(cells_per_unit_);
    const int column = static_cast<int>(std::floor(at.x() + 0.5 * columns_)),
              row = static_cast<int>(std::floor(at.y() + 0.5 * rows_));
    if (column < 0 || row < 0 || column >= columns_ || row >= rows_) continue;
    for (int k = -1; k <= 1; ++k)
      distances[static_cast<std::size_t>((middle + k + kDirections) % kDirections)]
               [static_cast<std::size_t>(row * columns_ + column)] = 0;
  }
}

/// Chamfer distances in cells, two passes.
void LineScores::transform(Plane& d) const {
  constexpr auto kDiagonal = static_cast<float>(M_SQRT2);
  const int w = columns_;
  for (int y = 1; y < rows_; ++y)
    for (int x = 1; x < w - 1; ++x) {
      float* at = d.data() + y * w + x;
      *at = std::min({*at, at[-1] + 1, at[-w] + 1, at[-w - 1] + kDiagonal, at[-w + 1] + kDiagonal});
    }
  for (int y = rows_ - 2; y >= 0; --y)
    for (int x = w - 2; x >= 1; --x) {
      float* at = d.data() + y * w + x;
      *at = std::min({*at, at[1] + 1, at[w] + 1, at[w + 1] + kDiagonal, at[w - 1] + kDiagonal});
    }
}

void LineScores::fill(const Plane& distances, const Camera& camera, int number, double spread) {
  // Likelihood, and its sums over all cells above and to the left.
  const auto w = static_cast<std::size_t>(columns_), h = static_cast<std::size_t>(rows_);
  Plane likelihood(w * h);
  std::vector<double> sums((w + 1) * (h + 1), 0.0);
  const auto scale = static_cast<float>(1 / (spread * static_cast<double>(cells_per_unit_)));
  for (std::size_t y = 0; y < h; ++y)
    for (std::size_t x = 0; x < w; ++x) {
      const float d = distances[y * w + x] * scale;
      likelihood[y * w + x] = d < 6 ? std::exp(-0.5F * d * d) : 0.0F;
      sums[(y + 1) * (w + 1) + x + 1] = static_cast<double>(likelihood[y * w + x]) +
                                        sums[y * (w + 1) + x + 1] + sums[(y + 1) * (w + 1) + x] -
                                        sums[y * (w + 1) + x];
    }
  const int reach = static_cast<int>(kBackground * static_cast<double>(cells_per_unit_));
  for (int y = 1; y + 1 < rows_; ++y)
    for (int x = 1; x + 1 < columns_; ++x) {
      const Eigen::Vector3d ray((x + 0.5 - 0.5 * columns_) / static_cast<double>(cells_per_unit_),
                                (y + 0.5 - 0.5 * rows_) / static_cast<double>(cells_per_unit_), 1);
      const auto pixel = camera.project(ray);
      if (!pixel || !camera.size().contains(*pixel)) continue;
      const auto x0 = static_cast<std::size_t>(std::max(1, x - reach)),
                 x1 = static_cast<std::size_t>(std::min(columns_ - 1, x + reach + 1)),
                 y0 = static_cast<std::size_t>(std::max(1, y - reach)),
                 y1 = static_cast<std::size_t>(std::min(rows_ - 1, y + reach + 1));
      const double sum = sums[y1 * (w + 1) + x1] - sums[y0 * (w + 1) + x1] - sums[y1 * (w + 1) + x0] +
                         sums[y0 * (w + 1) + x0];
      const float background =
          std::max(kLeastBackground, static_cast<float>(sum / static_cast<double>((x1 - x0) * (y1 - y0))));
      const std::size_t at = static_cast<std::size_t>(y) * w + static_cast<std::size_t>(x);
      scores_[static_cast<std::size_t>(number) * w * h + at] =
          std::log(1 - kSeenShare + kSeenShare * likelihood[at] / background);
    }
}

float LineScores::sum(const SeenPoints& points, const Eigen::Vector3f& offset) const {
  const Floats scale = all(cells_per_unit_), half_width = all(0.5F * static_cast<float>(columns_)),
               half_height = all(0.5F * static_cast<float>(rows_)), nearest = all(kNearest_m);
  const Floats zero{}, one = all(1), last_column = all(static_cast<float>(columns_) - 0.5F),
                       last_row = all(static_cast<float>(rows_) - 0.5F);
  const std::int32_t plane = columns_ * rows_, width = columns_;
  Floats total{};
  for (std::size_t i = 0; i < points.x_.size(); i += kSide) {
    const Floats z = load<Floats>(&points.z_[i]) + offset.z();
    const Floats inverse = one / (z > nearest ? z : nearest);
    Floats column = (load<Floats>(&points.x_[i]) + offset.x()) * inverse * scale + half_width,
           row = (load<Floats>(&points.y_[i]) + offset.y()) * inverse * scale + half_height;
    // The table's border is outside of the image.
    column = column > zero ? column : zero;
    column = column < last_column ? column : last_column;
    row = row > zero ? row : zero;
    row = row < last_row ? row : last_row;
    column = z > nearest ? column : zero;
    const Ints at = load<Ints>(&points.direction_[i]) * plane + __builtin_convertvector(row, Ints) * width +
                    __builtin_convertvector(column, Ints);
    Floats score;
    for (std::size_t k = 0; k < kSide; ++k) score[k] = scores_[static_cast<std::size_t>(at[k])];
    total += score;
  }
  float out = 0;
  for (std::size_t k = 0; k < kSide; ++k) out += total[k];
  return out - kOutsideScore * static_cast<float>(points.x_.size() - points.count_);
}

}  // namespace evpose
