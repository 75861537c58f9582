// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/relocalization/edge_lines.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>

namespace evpose {
namespace {

constexpr int kWideImage_px = 800;  // from here on two pixels make one cell, as in EdgeField
constexpr int kDirections = 32;
constexpr int kReach_cells = 10;       // around a seed
constexpr double kNear_cells = 2.5;    // nearer ones lie in any direction
constexpr double kAcross_cells = 1.1;  // so far from a line a cell still speaks for it
constexpr float kLeastSignificance = 4;
constexpr double kStep_cells = 8;  // by which a line grows
constexpr double kFill = 0.45;     // of the steps' cells, with events
constexpr double kLeastLength_cells = 16;
constexpr int kTaken_cells = 2;  // around a line

Eigen::Vector2d unit(double angle) { return {std::cos(angle), std::sin(angle)}; }

/// Through the cells' middle along their greatest extent.
struct Line {
  Eigen::Vector2d middle, along;
};
Line fit(std::span<const Eigen::Vector2d> cells) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& c : cells) mean += c;
  mean /= static_cast<double>(cells.size());
  double a = 0, b = 0, c = 0;
  for (const Eigen::Vector2d& cell : cells) {
    const Eigen::Vector2d d = cell - mean;
    a += d.x() * d.x(), b += d.x() * d.y(), c += d.y() * d.y();
  }
  return {mean, unit(0.5 * std::atan2(2 * b, a - c))};
}

/// Calls visit(place along the line, cells across it, column, row) for the cells within `wide` of a part of
/// the line.
template <class Visit>
void for_cells(const Line& line, double from, double to, int wide, const Visit& visit) {
  for (int s = static_cast<int>(std::ceil(from)); s <= static_cast<int>(std::floor(to)); ++s)
    for (int across = -wide; across <= wide; ++across) {
      const Eigen::Vector2d at =
          line.middle + s * line.along + across * Eigen::Vector2d(-line.along.y(), line.along.x());
      visit(s, across, static_cast<int>(std::lround(at.x())), static_cast<int>(std::lround(at.y())));
    }
}

}  // namespace

EdgeLineFinder::EdgeLineFinder(ImageSize size)
    : cell_px_(size.width > kWideImage_px ? 2 : 1),
      columns_((size.width + cell_px_ - 1) / cell_px_),
      rows_((size.height + cell_px_ - 1) / cell_px_) {
  active_.resize(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_));
  shares_.assign(kDirections, 0.0F);
  for (int row = -kReach_cells; row <= kReach_cells; ++row)
    for (int column = -kReach_cells; column <= kReach_cells; ++column) {
      const double r = std::hypot(row, column);
      if (r < kNear_cells || r > kReach_cells) continue;
      Offset offset{column, row, 0};
      for (int k = 0; k < kDirections; ++k) {
        const Eigen::Vector2d along = unit(std::numbers::pi * k / kDirections);
        if (std::abs(along.x() * row - along.y() * column) > kAcross_cells) continue;
        offset.directions |= 1U << k;
        shares_[static_cast<std::size_t>(k)] += 1;
      }
      offsets_.push_back(offset);
    }
  for (float& share : shares_) share /= static_cast<float>(offsets_.size());
}

std::vector<EdgeLine> EdgeLineFinder::find(std::span<const FilteredEvent> events) {
  std::vector<EdgeLine> lines;
  for (const unsigned polarity : {0U, 1U}) {
    std::fill(active_.begin(), active_.end(), std::uint8_t{0});
    for (const FilteredEvent& e : events)
      if (e.on == polarity)
        active_[static_cast<std::size_t>(e.y / cell_px_) * static_cast<std::size_t>(columns_) +
                static_cast<std::size_t>(e.x / cell_px_)] = 1;
    find_seeds();
    for (const Seed& seed : seeds_) grow(seed, lines);
  }
  return lines;
}

void EdgeLineFinder::find_seeds() {
  seeds_.clear();
  for (int row = kReach_cells; row < rows_ - kReach_cells; ++row)
    for (int column = kReach_cells; column < columns_ - kReach_cells; ++column) {
      const std::uint8_t* here = active_.data() + row * columns_ + column;
      if (*here == 0) continue;
      std::array<std::uint16_t, kDirections> votes{};
      int total = 0;
      for (const Offset& o : offsets_) {
        if (here[o.row * columns_ + o.column] == 0) continue;
        ++total;
        for (std::uint32_t bits = o.directions; bits != 0; bits &= bits - 1)
          ++votes[static_cast<std::size_t>(__builtin_ctz(bits))];
      }
      const auto best =
          static_cast<std::size_t>(std::max_element(votes.begin(), votes.end()) - votes.begin());
      const float expected = shares_[best] * static_cast<float>(total);
      const float significance = (votes[best] - expected) / std::sqrt(expected + 1);
      if (significance > kLeastSignificance)
        seeds_.push_back({column, row, static_cast<std::uint16_t>(best), significance});
    }
  std::stable_sort(seeds_.begin(), seeds_.end(),
                   [](const Seed& a, const Seed& b) { return a.significance > b.significance; });
}

void EdgeLineFinder::grow(const Seed& seed, std::vector<EdgeLine>& lines) {
  const auto index = [&](int column, int row) {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
           static_cast<std::size_t>(column);
  };
  if (active_[index(seed.column, seed.row)] != 1) return;
  Line line{{seed.column, seed.row}, unit(std::numbers::pi * seed.direction / kDirections)};
  // Cells of the line between two places along it; those of other lines count only there.
  const auto collect = [&](double from, double to) {
    int filled = 0;
    std::optional<int> last;
    for_cells(line, from, to, 1, [&](int s, int /*across*/, int column, int row) {
      if (!active(column, row)) return;
      members_.emplace_back(column, row);
      filled += last == s ? 0 : 1;
      last = s;
    });
    return filled;
  };
  members_.clear();
  double low = -kReach_cells, high = kReach_cells;
  collect(low, high);
  if (members_.size() < 4) return;
  const auto refit = [&] {
    const Line fitted = fit(members_);
    // Places along the line stay what they were.
    const double shift = (fitted.middle - line.middle).dot(line.along);
    line.along = fitted.along.dot(line.along) < 0 ? Eigen::Vector2d(-fitted.along) : fitted.along;
    line.middle = fitted.middle;
    low -= shift, high -= shift;
  };
  refit();
  for (bool grown = true; grown;) {
    grown = false;
    if (collect(high + 1, high + kStep_cells) >= kFill * kStep_cells) high += kStep_cells, grown = true;
    if (collect(low - kStep_cells, low - 1) >= kFill * kStep_cells) low -= kStep_cells, grown = true;
    members_.clear();
    collect(low, high);
    if (members_.size() < 4) return;
    refit();
  }
  // The ends, and cells that no other line may begin at.
  double first = high, last = low;
  int filled = 0, fresh = 0;
  for_cells(line, std::trunc(low), std::trunc(high), kTaken_cells,
            [&](int s, int across, int column, int row) {
              if (!active(column, row)) return;
              fresh += active_[index(column, row)] == 1 ? 1 : 0;
              active_[index(column, row)] = 2;
              if (std::abs(across) > 1) return;
              filled += s == last && filled > 0 ? 0 : 1;
              first = std::min<double>(first, s), last = s;
            });
  const double length = last - first;
  if (length < kLeastLength_cells || filled < kFill * length || fresh < 0.5 * filled) return;
  const Eigen::Vector2d offset = Eigen::Vector2d::Constant(0.5 * (cell_px_ - 1));  // of a cell's middle
  lines.push_back({(line.middle + first * line.along) * cell_px_ + offset,
                   (line.middle + last * line.along) * cell_px_ + offset});
}

}  // namespace evpose
