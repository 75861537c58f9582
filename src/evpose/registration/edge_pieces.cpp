// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/edge_pieces.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace evpose {
namespace {

constexpr int kBlock_px = 12,
              kRim_px = 3;  // the rim of a block begins no piece: neighbours would be the same
constexpr int kRadius_px = 4;
constexpr double kFewest = 6;          // pixels with events
constexpr double kLinearity = 0.7;     // (l1 - l0) / (l1 + l0) of the eigenvalues of their scatter
constexpr double kWidest_px = 0.9;     // across the line, 1 sigma
constexpr double kSharpest_px2 = 0.1;  // variance of an event across its edge, at least
constexpr std::size_t kTries = 4;      // events of a block that are looked at
constexpr std::size_t kMost = 500;
constexpr std::uint32_t kUnit_us = 4;  // of ages

}  // namespace

EdgePieceFinder::EdgePieceFinder(ImageSize size)
    : size_(size),
      blocks_(static_cast<std::size_t>(size.width / kBlock_px) *
              static_cast<std::size_t>(size.height / kBlock_px)) {
  for (auto& plane : age_)
    plane.resize(static_cast<std::size_t>(size.width) * static_cast<std::size_t>(size.height));
}

/// The line through the events around this one; score 0: there is none.
EdgePieceFinder::Scored EdgePieceFinder::piece_at(const FilteredEvent& e) const {
  const std::vector<std::uint16_t>& ages = age_[e.on];
  double n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0, syy = 0, age = 0;
  for (int y = -kRadius_px; y <= kRadius_px; ++y)
    for (int x = -kRadius_px; x <= kRadius_px; ++x) {
      const std::uint16_t there = ages[pixel_of(e.x + x, e.y + y)];
      if (there == 0) continue;
      ++n, sx += x, sy += y, sxx += x * x, sxy += x * y, syy += y * y;
      age += there;
    }
  if (n < kFewest) return {};
  const double mx = sx / n, my = sy / n;
  const double a = sxx / n - mx * mx, b = sxy / n - mx * my, c = syy / n - my * my;
  const double difference = std::hypot(a - c, 2 * b), across = std::max(0.0, 0.5 * (a + c - difference));
  if (difference < kLinearity * (a + c) || across > kWidest_px * kWidest_px) return {};
  const double angle = 0.5 * std::atan2(2 * b, a - c);
  return {n * difference / (a + c),
          {{e.x + mx, e.y + my},
           {-std::sin(angle), std::cos(angle)},
           1e-6 * kUnit_us * age / n,
           std::sqrt(std::max(across, kSharpest_px2) / n)}};
}

std::vector<EdgePiece> EdgePieceFinder::find(std::span<const FilteredEvent> events, std::uint32_t now_us) {
  const int columns = size_.width / kBlock_px, rows = size_.height / kBlock_px;
  for (auto& block : blocks_) block.clear();
  for (std::uint32_t i = 0; i < events.size(); ++i) {
    const FilteredEvent& e = events[i];
    const auto age =
        static_cast<std::uint16_t>(std::min<std::uint32_t>((now_us - e.stamp_us) / kUnit_us + 1, 0xFFFF));
    std::uint16_t& newest = age_[e.on][pixel_of(e.x, e.y)];
    newest = newest == 0 ? age : std::min(newest, age);
    const int x = e.x % kBlock_px, y = e.y % kBlock_px;
    const bool in_rim = std::min(x, y) < kRim_px || std::max(x, y) >= kBlock_px - kRim_px;
    if (in_rim || e.x / kBlock_px >= columns || e.y / kBlock_px >= rows ||
        !size_.contains({static_cast<double>(e.x), static_cast<double>(e.y)}, kRadius_px))
      continue;
    blocks_[static_cast<std::size_t>(e.y / kBlock_px * columns + e.x / kBlock_px)].push_back(i);
  }
  std::vector<Scored> found;
  for (const auto& block : blocks_) {
    Scored best{0, {Eigen::Vector2d::Zero(), Eigen::Vector2d::UnitX(), 0, 0}};
    const std::size_t step = std::max<std::size_t>(1, block.size() / kTries);
    for (std::size_t k = 0; k < block.size(); k += step)
      if (const Scored s = piece_at(events[block[k]]); s.score > best.score) best = s;
    if (best.score > 0) found.push_back(best);
  }
  for (const FilteredEvent& e : events) age_[e.on][pixel_of(e.x, e.y)] = 0;
  if (found.size() > kMost) {
    std::stable_sort(found.begin(), found.end(),
                     [](const Scored& a, const Scored& b) { return a.score > b.score; });
    found.resize(kMost);
  }
  std::vector<EdgePiece> out;
  for (const Scored& s : found) out.push_back(s.piece);
  return out;
}

}  // namespace evpose
