// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/coarse_ranking.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "evpose/core/float_lanes.h"

namespace evpose {
namespace {

using lanes::all;
using lanes::Floats;
using lanes::Ints;
using lanes::kSide;
using lanes::load;

constexpr double kCell_px = 2;       // of the table, and the step of turns; the fine spread is 1.5 px
constexpr double kWidestTan = 2.5;   // of an image that is wider, the rim is left out
constexpr float kNearest_m = 0.05F;  // points nearer to the camera are not projected
constexpr double kMargin_px = 2;
constexpr int kDirections = EdgeField::kDirections;
constexpr float kStep = 0.04F;                        // of a point's score
constexpr int kMostSteps = 93;                        // 3.7, more than an edge in empty surroundings tells
constexpr std::size_t kAddable = 65535 / kMostSteps;  // points, in 16 bits; two of them in eight

using Bytes = std::uint8_t __attribute__((vector_size(16)));
using Words = std::uint16_t __attribute__((vector_size(32)));

Floats magnitude(Floats v) { return v < 0 ? -v : v; }
Floats limited(Floats v, float from, float to) {
  v = v < from ? all(from) : v;
  return to < v ? all(to) : v;
}

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
  padded_ = (count_ + kSide - 1) / kSide * kSide;
  points_.assign(6 * padded_, 0.0F);
  entries_.resize(padded_);
  for (std::size_t i = 0; i < count_; ++i) {
    const SearchPoint& point = points[i];
    for (std::size_t k = 0; k < 3; ++k) {
      points_[k * padded_ + i] =
          static_cast<float>(point.position[static_cast<int>(k)] - origin[static_cast<int>(k)]);
      points_[(3 + k) * padded_ + i] = static_cast<float>(point.tangent[static_cast<int>(k)]);
    }
  }
}

std::span<const std::int32_t> CoarseScores::find_entries(const Eigen::Matrix3f& R,
                                                         const Eigen::Vector3f& t) const {
  const float *px = points_.data(), *py = px + padded_, *pz = py + padded_, *tx = pz + padded_,
              *ty = tx + padded_, *tz = ty + padded_;
  const int plane = columns_ * rows_, width = columns_;
  constexpr int kReach = kTurns / 2;
  constexpr auto kRim = static_cast<float>(kReach);
  const float last_column = static_cast<float>(columns_) - kRim, last_row = static_cast<float>(rows_) - kRim;
  std::size_t inside = 0;
  for (std::size_t i = 0; i < count_; i += kSide) {
    const auto X = load<Floats>(px + i), Y = load<Floats>(py + i), Z = load<Floats>(pz + i);
    const Floats x = R(0, 0) * X + R(0, 1) * Y + R(0, 2) * Z + t.x();
    const Floats y = R(1, 0) * X + R(1, 1) * Y + R(1, 2) * Z + t.y();
    const Floats z = R(2, 0) * X + R(2, 1) * Y + R(2, 2) * Z + t.z();
    const Floats scale = 1 / (z < kNearest_m ? all(kNearest_m) : z), u = x * scale, v = y * scale;
    const auto TX = load<Floats>(tx + i), TY = load<Floats>(ty + i), TZ = load<Floats>(tz + i);
    const Floats dz = R(2, 0) * TX + R(2, 1) * TY + R(2, 2) * TZ;
    const Floats du = R(0, 0) * TX + R(0, 1) * TY + R(0, 2) * TZ - u * dz;
    const Floats dv = R(1, 0) * TX + R(1, 1) * TY + R(1, 2) * TZ - v * dz;
    const Floats a = magnitude(du), b = magnitude(dv), sum = a + b;
    const Floats turn = (du * dv >= 0 ? b : 2 * a + b) / (sum < 1e-12F ? all(1e-12F) : sum);  // 0 .. 2
    const Ints direction = __builtin_convertvector(0.5F * (kDirections * turn + 1), Ints) & (kDirections - 1);
    const Floats column = limited(u * cells_per_unit_ + half_width_, 0, last_column),
                 row = limited(v * cells_per_unit_ + half_height_, 0, last_row);
    const Ints seen =
        (z > kNearest_m) & (column >= kRim) & (row >= kRim) & (column < last_column) & (row < last_row);
    const Ints at = direction * plane + __builtin_convertvector(row, Ints) * width +
                    __builtin_convertvector(column, Ints);
    for (std::size_t k = 0; k < std::min(kSide, count_ - i); ++k) {
      entries_[inside] = at[k];
      inside -= static_cast<std::size_t>(seen[k]);
    }
  }
  return {entries_.data(), inside};
}

void CoarseScores::add_turns(std::span<const std::int32_t> entries, std::uint32_t* sums) const {
  constexpr int kRows = kTurns / 2;  // as many sums as there are registers
  const std::uint8_t* begin = scores_.data() - kTurns / 2 * (columns_ + 1);
  for (int half = 0; half < kTurns; half += kRows, begin += kRows * columns_) {
    std::array<Words, kRows> total{};
    const std::size_t even = entries.size() / 2 * 2;
    for (std::size_t i = 0; i < even; i += 2) {
      const std::uint8_t *one = begin + entries[i], *other = begin + entries[i + 1];
      for (int row = 0; row < kRows; ++row) {
        const Bytes two = load<Bytes>(one + row * columns_) + load<Bytes>(other + row * columns_);
        total[static_cast<std::size_t>(row)] += __builtin_convertvector(two, Words);
      }
    }
    for (int row = 0; row < kRows; ++row) {
      Words& words = total[static_cast<std::size_t>(row)];
      if (even < entries.size())
        words += __builtin_convertvector(load<Bytes>(begin + entries[even] + row * columns_), Words);
      for (int column = 0; column < kTurns; ++column) sums[(half + row) * kTurns + column] += words[column];
    }
  }
}

CoarseScores::Turned CoarseScores::best_turn(const Eigen::Matrix3f& R, const Eigen::Vector3f& t) const {
  const std::span<const std::int32_t> entries = find_entries(R, t);
  const std::size_t inside = entries.size();
  std::array<std::uint32_t, static_cast<std::size_t>(kTurns * kTurns)> sums{};
  for (std::size_t begin = 0; begin < inside; begin += kAddable)
    add_turns(entries.subspan(begin, std::min(kAddable, inside - begin)), sums.data());
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
