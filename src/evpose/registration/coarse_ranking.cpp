// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/coarse_ranking.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace evpose {
namespace {

constexpr double kCell_px = 2;       // of the table, and the step of turns; the fine spread is 1.5 px
constexpr double kWidestTan = 2.5;   // of an image that is wider, the rim is left out
constexpr float kNearest_m = 0.05F;  // points nearer to the camera are not projected
constexpr double kMargin_px = 2;
constexpr int kDirections = EdgeField::kDirections;
constexpr float kStep = 0.04F;                        // of a point's score
constexpr int kMostSteps = 93;                        // 3.7, more than an edge in empty surroundings tells
constexpr std::size_t kAddable = 65535 / kMostSteps;  // points, in 16 bits

/// A direction by its number: evenly along the sides of a square, which needs no arc tangent.
Eigen::Vector2d direction_of(int number) {
  const double turn = 2.0 * number / kDirections;  // 0 .. 2
  return turn < 1 ? Eigen::Vector2d(1 - turn, turn) : Eigen::Vector2d(1 - turn, 2 - turn);
}

}  // namespace

Eigen::Vector2d half_view(const Camera& camera) {
  Eigen::Vector2d widest(0.1, 0.1);
  const ImageSize size = camera.size();
  for (const double u : {0.0, 0.5, 1.0})
    for (const double v : {0.0, 0.5, 1.0}) {
      const auto ray = camera.unproject({u * (size.width - 1), v * (size.height - 1)});
      if (ray && ray->z() > 0.1) widest = widest.cwiseMax((ray->head<2>() / ray->z()).cwiseAbs());
    }
  return widest.cwiseMin(kWidestTan);
}

CoarseScores::CoarseScores(const EdgeField& field, const Camera& camera, float seen_share,
                           float outside_score)
    : cells_per_unit_(static_cast<float>(camera.focal_px() / kCell_px)),
      outside_score_(outside_score),
      lowest_(std::log(1 - seen_share)) {
  const Eigen::Vector2d half = half_view(camera) * camera.focal_px() / kCell_px;
  columns_ = 2 * static_cast<int>(std::ceil(half.x())) + 1 + kTurns;
  rows_ = 2 * static_cast<int>(std::ceil(half.y())) + 1 + kTurns;
  half_width_ = 0.5F * static_cast<float>(columns_);
  half_height_ = 0.5F * static_cast<float>(rows_);
  scores_.assign(entry(0, 0, kDirections), steps(outside_score));
  for (int row = 0; row < rows_; ++row)
    for (int column = 0; column < columns_; ++column) fill_cell(field, camera, column, row, seen_share);
}

void CoarseScores::fill_cell(const EdgeField& field, const Camera& camera, int column, int row,
                             float seen_share) {
  const Eigen::Vector3d ray((column + 0.5 - half_width_) / cells_per_unit_,
                            (row + 0.5 - half_height_) / cells_per_unit_, 1);
  Matrix23d J;
  const auto pixel = camera.project(ray, &J);
  if (!pixel || !camera.size().contains(*pixel, kMargin_px)) return;
  for (int k = 0; k < kDirections; ++k) {
    const Eigen::Vector2d along = J.leftCols<2>() * direction_of(k);
    const int direction = EdgeField::direction(along.x(), along.y());
    const float ratio = field.likelihood_ratio(pixel->x(), pixel->y(), direction, EdgeSpread::fine);
    scores_[entry(column, row, k)] = steps(std::log(1 - seen_share + seen_share * ratio));
  }
}

std::uint8_t CoarseScores::steps(float score) const {
  return static_cast<std::uint8_t>(std::clamp(std::lround((score - lowest_) / kStep), 0L, long{kMostSteps}));
}

void CoarseScores::set_points(std::span<const SearchPoint> points, const Eigen::Vector3d& origin) {
  count_ = points.size();
  points_.resize(6 * count_);
  entries_.resize(count_);
  for (std::size_t i = 0; i < count_; ++i) {
    const SearchPoint& point = points[i];
    for (std::size_t k = 0; k < 3; ++k) {
      points_[k * count_ + i] =
          static_cast<float>(point.position[static_cast<int>(k)] - origin[static_cast<int>(k)]);
      points_[(3 + k) * count_ + i] = static_cast<float>(point.tangent[static_cast<int>(k)]);
    }
  }
}

void CoarseScores::find_entries(const Eigen::Matrix3f& R, const Eigen::Vector3f& t) const {
  const float *px = points_.data(), *py = px + count_, *pz = py + count_, *tx = pz + count_,
              *ty = tx + count_, *tz = ty + count_;
  const int plane = columns_ * rows_, width = columns_;
  constexpr int kReach = kTurns / 2;
  constexpr auto kRim = static_cast<float>(kReach);
  const float last_column = static_cast<float>(columns_) - kRim, last_row = static_cast<float>(rows_) - kRim;
  std::int32_t* entries = entries_.data();
  for (std::size_t i = 0; i < count_; ++i) {
    const float x = R(0, 0) * px[i] + R(0, 1) * py[i] + R(0, 2) * pz[i] + t.x();
    const float y = R(1, 0) * px[i] + R(1, 1) * py[i] + R(1, 2) * pz[i] + t.y();
    const float z = R(2, 0) * px[i] + R(2, 1) * py[i] + R(2, 2) * pz[i] + t.z();
    const float scale = 1 / std::max(z, kNearest_m), u = x * scale, v = y * scale;
    const float dz = R(2, 0) * tx[i] + R(2, 1) * ty[i] + R(2, 2) * tz[i];
    const float du = R(0, 0) * tx[i] + R(0, 1) * ty[i] + R(0, 2) * tz[i] - u * dz;
    const float dv = R(1, 0) * tx[i] + R(1, 1) * ty[i] + R(1, 2) * tz[i] - v * dz;
    const float a = std::abs(du), b = std::abs(dv);
    const float turn = (du * dv >= 0 ? b : 2 * a + b) / std::max(a + b, 1e-12F);  // 0 .. 2, as direction_of()
    const int direction = static_cast<int>(0.5F * (kDirections * turn + 1)) & (kDirections - 1);
    const float column = std::min(std::max(u * cells_per_unit_ + half_width_, 0.0F), last_column),
                row = std::min(std::max(v * cells_per_unit_ + half_height_, 0.0F), last_row);
    const bool inside =
        z > kNearest_m && column >= kRim && row >= kRim && column < last_column && row < last_row;
    const int at = direction * plane + static_cast<int>(row) * width + static_cast<int>(column);
    entries[i] = inside ? at : -1;
  }
}

CoarseScores::Turned CoarseScores::best_turn(const Eigen::Matrix3f& R, const Eigen::Vector3f& t) const {
  find_entries(R, t);
  constexpr auto kAll = static_cast<std::size_t>(kTurns * kTurns);
  std::array<std::uint32_t, kAll> sums{};
  std::size_t inside = 0;
  for (std::size_t begin = 0; begin < entries_.size(); begin += kAddable) {
    std::array<std::uint16_t, kAll> part{};
    for (std::size_t i = begin; i < std::min(begin + kAddable, entries_.size()); ++i) {
      if (entries_[i] < 0) continue;
      ++inside;
      const std::uint8_t* from = scores_.data() + entries_[i] - kTurns / 2 * (columns_ + 1);
      std::uint16_t* sum = part.data();
      for (int row = 0; row < kTurns; ++row, from += columns_, sum += kTurns)
        for (int column = 0; column < kTurns; ++column)
          sum[column] = static_cast<std::uint16_t>(sum[column] + from[column]);
    }
    for (std::size_t k = 0; k < kAll; ++k) sums[k] += part[k];
  }
  const auto best = static_cast<int>(std::ranges::max_element(sums) - sums.begin());
  const int column = best % kTurns - kTurns / 2, row = best / kTurns - kTurns / 2;
  const double x = column / static_cast<double>(cells_per_unit_),
               y = row / static_cast<double>(cells_per_unit_);
  const double total = static_cast<double>(kStep) * sums[static_cast<std::size_t>(best)] +
                       static_cast<double>(lowest_) * static_cast<double>(inside) +
                       static_cast<double>(outside_score_) * static_cast<double>(count_ - inside);
  return {{y, -x, 0}, count_ > 0 ? total / static_cast<double>(count_) : 0};
}

}  // namespace evpose
