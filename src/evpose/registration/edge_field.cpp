// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/edge_field.h"

#include <algorithm>
#include <cmath>

namespace evpose {
namespace {

constexpr int kWideImage_px = 800;  // from here on two pixels make one cell
constexpr int kPatch = 3;           // cells to each side that tell an edge's direction
constexpr int kFewest = 5;          // of them
constexpr double kLinear = 0.5;     // (l1 - l0) / (l1 + l0) of their spread
constexpr int kBlock = 16;          // cells; chance is counted over 5 x 5 blocks
constexpr int kAround = 2;
constexpr float kLeastChance = 0.01F;

}  // namespace

EdgeField::EdgeField(ImageSize size)
    : size_(size),
      cell_(size.width > kWideImage_px ? 2 : 1),
      columns_((size.width + cell_ - 1) / cell_),
      rows_((size.height + cell_ - 1) / cell_),
      block_columns_((columns_ + kBlock - 1) / kBlock),
      block_rows_((rows_ + kBlock - 1) / kBlock) {
  const std::size_t n = static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_);
  active_.resize(n);
  for (Plane& plane : planes_) plane.resize(n);
  for (auto& spread : chance_)
    for (Plane& plane : spread)
      plane.resize(static_cast<std::size_t>(block_columns_) * static_cast<std::size_t>(block_rows_));
}

void EdgeField::set_spreads(float coarse_px, float fine_px) { spreads_ = {coarse_px, fine_px}; }

int EdgeField::direction(double x, double y) {
  const double turn = std::atan2(y, x) / M_PI;  // -1 .. 1, lines repeat after 1
  return static_cast<int>(std::floor((turn + 1) * kDirections + 0.5)) % kDirections;
}

void EdgeField::build(std::span<const FrontEvent> events) {
  std::fill(active_.begin(), active_.end(), std::uint8_t{0});
  for (const FrontEvent& e : events)
    active_[static_cast<std::size_t>(e.y / cell_) * static_cast<std::size_t>(columns_) +
            static_cast<std::size_t>(e.x / cell_)] = 1;
  for (Plane& plane : planes_) std::fill(plane.begin(), plane.end(), kReach_px);
  edges_ = 0;
  for (int row = kPatch; row < rows_ - kPatch; ++row)
    for (int column = kPatch; column < columns_ - kPatch; ++column) {
      const std::size_t here = static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
                               static_cast<std::size_t>(column);
      if (!active_[here]) continue;
      int n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0, syy = 0;
      for (int y = -kPatch; y <= kPatch; ++y)
        for (int x = -kPatch; x <= kPatch; ++x)
          if (active_[here + static_cast<std::size_t>(y * columns_ + x)])
            ++n, sx += x, sy += y, sxx += x * x, sxy += x * y, syy += y * y;
      if (n < kFewest) continue;
      const double mx = static_cast<double>(sx) / n, my = static_cast<double>(sy) / n;
      const double a = static_cast<double>(sxx) / n - mx * mx, b = static_cast<double>(sxy) / n - mx * my,
                   c = static_cast<double>(syy) / n - my * my;
      const double difference = std::hypot(a - c, 2 * b);
      if (difference < kLinear * (a + c)) continue;
      ++edges_;
      const double angle = 0.5 * std::atan2(2 * b, a - c);
      const int middle = direction(std::cos(angle), std::sin(angle));
      for (int k = -1; k <= 1; ++k)
        planes_[static_cast<std::size_t>((middle + k + kDirections) % kDirections)][here] = 0;
    }
  for (Plane& plane : planes_) transform(plane);
  count_chance();
}

/// Chamfer distances, two passes.
void EdgeField::transform(Plane& plane) const {
  const auto straight = static_cast<float>(cell_), diagonal = static_cast<float>(M_SQRT2) * straight;
  const auto at = [&](int x, int y) -> float& {
    return plane[static_cast<std::size_t>(y) * static_cast<std::size_t>(columns_) +
                 static_cast<std::size_t>(x)];
  };
  for (int y = 1; y < rows_; ++y)
    for (int x = 1; x < columns_ - 1; ++x)
      at(x, y) = std::min({at(x, y), at(x - 1, y) + straight, at(x, y - 1) + straight,
                           at(x - 1, y - 1) + diagonal, at(x + 1, y - 1) + diagonal});
  for (int y = rows_ - 2; y >= 0; --y)
    for (int x = columns_ - 2; x >= 1; --x)
      at(x, y) = std::min({at(x, y), at(x + 1, y) + straight, at(x, y + 1) + straight,
                           at(x + 1, y + 1) + diagonal, at(x - 1, y + 1) + diagonal});
}

void EdgeField::count_chance() {
  std::array<float, static_cast<std::size_t>(kReach_px * 4) + 2> bell;
  for (std::size_t s = 0; s < 2; ++s) {
    for (std::size_t i = 0; i < bell.size(); ++i) {
      const float d = static_cast<float>(i) / 4 / spreads_[s];
      bell[i] = std::exp(-0.5F * d * d);
    }
    for (std::size_t k = 0; k < kDirections; ++k) {
      Plane sums(chance_[s][k].size());
      for (int y = 0; y < rows_; ++y)
        for (int x = 0; x < columns_; ++x)
          sums[static_cast<std::size_t>(y / kBlock) * static_cast<std::size_t>(block_columns_) +
               static_cast<std::size_t>(x / kBlock)] +=
              bell[static_cast<std::size_t>(4 * at(x, y, static_cast<int>(k)))];
      for (int y = 0; y < block_rows_; ++y)
        for (int x = 0; x < block_columns_; ++x) {
          float sum = 0;
          int cells = 0;
          for (int v = std::max(0, y - kAround); v <= std::min(block_rows_ - 1, y + kAround); ++v)
            for (int u = std::max(0, x - kAround); u <= std::min(block_columns_ - 1, x + kAround); ++u) {
              sum += sums[static_cast<std::size_t>(v) * static_cast<std::size_t>(block_columns_) +
                          static_cast<std::size_t>(u)];
              cells += std::min(kBlock, columns_ - u * kBlock) * std::min(kBlock, rows_ - v * kBlock);
            }
          chance_[s][k][static_cast<std::size_t>(y) * static_cast<std::size_t>(block_columns_) +
                        static_cast<std::size_t>(x)] =
              std::max(kLeastChance, sum / static_cast<float>(cells));
        }
    }
  }
}

EdgeField::Sample EdgeField::sample(double x, double y, int direction) const {
  const double u = std::clamp(x / cell_, 0.0, columns_ - 1.001),
               v = std::clamp(y / cell_, 0.0, rows_ - 1.001);
  const int column = static_cast<int>(u), row = static_cast<int>(v);
  const auto fx = static_cast<float>(u - column), fy = static_cast<float>(v - row);
  const float a = at(column, row, direction), b = at(column + 1, row, direction),
              c = at(column, row + 1, direction), d = at(column + 1, row + 1, direction);
  const auto cell = static_cast<float>(cell_);
  return {(a * (1 - fx) + b * fx) * (1 - fy) + (c * (1 - fx) + d * fx) * fy,
          ((b - a) * (1 - fy) + (d - c) * fy) / cell, ((c - a) * (1 - fx) + (d - b) * fx) / cell};
}

float EdgeField::chance(double x, double y, int direction, int spread) const {
  const int column = std::clamp(static_cast<int>(x) / cell_ / kBlock, 0, block_columns_ - 1),
            row = std::clamp(static_cast<int>(y) / cell_ / kBlock, 0, block_rows_ - 1);
  return chance_[static_cast<std::size_t>(spread)][static_cast<std::size_t>(direction)]
                [static_cast<std::size_t>(row) * static_cast<std::size_t>(block_columns_) +
                 static_cast<std::size_t>(column)];
}

float EdgeField::odds(double x, double y, int direction, int spread) const {
  const int column = std::clamp(static_cast<int>(std::lround(x)) / cell_, 0, columns_ - 1),
            row = std::clamp(static_cast<int>(std::lround(y)) / cell_, 0, rows_ - 1);
  const float d = at(column, row, direction) / spreads_[static_cast<std::size_t>(spread)];
  return std::exp(-0.5F * d * d) / chance(x, y, direction, spread);
}

}  // namespace evpose
