// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/calibrate/event_lines.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace evpose {
namespace {

constexpr int kAngles = 180;          // of the normal over half a turn
constexpr double kOffsetStep_px = 2;  // of the accumulator
constexpr int kPatch_px = 3;          // to each side, whose pixels tell a line's direction
constexpr int kLeastOfPatch = 5;      // active ones
constexpr double kLeastLinearity = 0.5;
constexpr int kSpread_deg = 8;       // that the direction of a patch may be wrong
constexpr double kBand_px = 3;       // around a line, whose pixels are its own
constexpr double kLeastShare = 0.1;  // of the image's height: pixels of a line
constexpr int kMostLines = 60, kRefinements = 3;

struct EdgePixel {
  Eigen::Vector2d at;
  int angle;  ///< of the normal, degrees from 0 to 179
  bool free = true;
};

Eigen::Vector2d direction(int angle) {
  return {std::cos(angle * M_PI / kAngles), std::sin(angle * M_PI / kAngles)};
}

int angle_between(int a, int b) {
  const int d = std::abs(a - b) % kAngles;
  return std::min(d, kAngles - d);
}

/// Pixels with events whose neighbours form a line, each once.
std::vector<EdgePixel> edge_pixels(std::span<const FilteredEvent> events, ImageSize size) {
  std::vector<std::uint8_t> active(static_cast<std::size_t>(size.width) *
                                   static_cast<std::size_t>(size.height));
  const auto at = [&](int x, int y) -> std::uint8_t& {
    return active[static_cast<std::size_t>(y) * static_cast<std::size_t>(size.width) +
                  static_cast<std::size_t>(x)];
  };
  for (const FilteredEvent& e : events) at(e.x, e.y) = 1;
  std::vector<EdgePixel> out;
  for (int y = kPatch_px; y < size.height - kPatch_px; ++y)
    for (int x = kPatch_px; x < size.width - kPatch_px; ++x) {
      if (!at(x, y)) continue;
      int n = 0;
      Eigen::Vector2d sum = Eigen::Vector2d::Zero();
      Eigen::Matrix2d square = Eigen::Matrix2d::Zero();
      for (int dy = -kPatch_px; dy <= kPatch_px; ++dy)
        for (int dx = -kPatch_px; dx <= kPatch_px; ++dx) {
          if (!at(x + dx, y + dy)) continue;
          const Eigen::Vector2d d(dx, dy);
          sum += d, square += d * d.transpose(), ++n;
        }
      if (n < kLeastOfPatch) continue;
      const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> scatter(square - sum * sum.transpose() / n);
      const Eigen::Vector2d l = scatter.eigenvalues(), normal = scatter.eigenvectors().col(0);
      if (!(l(1) - l(0) > kLeastLinearity * (l(1) + l(0)))) continue;
      const double turn = std::atan2(normal.y(), normal.x()) / M_PI * kAngles;
      out.push_back({{x, y}, (static_cast<int>(std::lround(turn)) + 2 * kAngles) % kAngles});
    }
  return out;
}

class Accumulator {
 public:
  explicit Accumulator(ImageSize size)
      : reach_(std::hypot(size.width, size.height)),
        bins_(static_cast<int>(2 * reach_ / kOffsetStep_px) + 3),
        votes_(static_cast<std::size_t>(kAngles) * static_cast<std::size_t>(bins_)) {}

  void vote(const EdgePixel& pixel, int count) {
    for (int turn = -kSpread_deg; turn <= kSpread_deg; ++turn) {
      const int angle = (pixel.angle + turn + kAngles) % kAngles;
      votes_[place(angle, direction(angle).dot(pixel.at))] += count;
    }
  }

  struct Peak {
    int angle, votes;
    double offset;
  };
  Peak highest() const {
    const auto best = static_cast<int>(std::ranges::max_element(votes_) - votes_.begin());
    return {best / bins_, votes_[static_cast<std::size_t>(best)],
            (best % bins_ - 1) * kOffsetStep_px - reach_};
  }

 private:
  std::size_t place(int angle, double offset) const {
    return static_cast<std::size_t>(angle * bins_ + 1 +
                                    static_cast<int>(std::lround((offset + reach_) / kOffsetStep_px)));
  }

  double reach_;
  int bins_;
  std::vector<int> votes_;
};

/// The line through the pixels beside it, by least squares.
EventLine refined(EventLine line, std::span<const EdgePixel> pixels) {
  for (int pass = 0; pass < kRefinements; ++pass) {
    const int angle =
        (static_cast<int>(std::lround(std::atan2(line.normal.y(), line.normal.x()) / M_PI * kAngles)) +
         2 * kAngles) %
        kAngles;
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    Eigen::Matrix2d square = Eigen::Matrix2d::Zero();
    int n = 0;
    for (const EdgePixel& p : pixels) {
      if (!p.free || std::abs(line.normal.dot(p.at) - line.offset) > kBand_px ||
          angle_between(angle, p.angle) > 2 * kSpread_deg)
        continue;
      sum += p.at, square += p.at * p.at.transpose(), ++n;
    }
    line.pixels = n;
    if (n < 3) return line;
    const Eigen::Vector2d mean = sum / n;
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> scatter(square / n - mean * mean.transpose());
    Eigen::Vector2d normal = scatter.eigenvectors().col(0);
    if (normal.x() < 0) normal = -normal;
    line.normal = normal;
    line.offset = normal.dot(mean);
  }
  return line;
}

}  // namespace

std::vector<EventLine> find_event_lines(std::span<const FilteredEvent> events, ImageSize size) {
  std::vector<EdgePixel> pixels = edge_pixels(events, size);
  Accumulator accumulator(size);
  for (const EdgePixel& p : pixels) accumulator.vote(p, 1);
  std::vector<EventLine> out;
  const int least = static_cast<int>(kLeastShare * size.height);
  while (out.size() < kMostLines) {
    const auto peak = accumulator.highest();
    if (peak.votes < least / 2) break;
    const EventLine line = refined({direction(peak.angle), peak.offset, 0}, pixels);
    bool taken = false;
    for (EdgePixel& p : pixels) {
      const bool on = std::abs(line.normal.dot(p.at) - line.offset) < kBand_px ||
                      std::abs(direction(peak.angle).dot(p.at) - peak.offset) < kBand_px;
      if (!p.free || !on || angle_between(peak.angle, p.angle) > 2 * kSpread_deg) continue;
      p.free = false;
      taken = true;
      accumulator.vote(p, -1);
    }
    if (line.pixels >= least) out.push_back(line);
    if (!taken) break;
  }
  std::ranges::stable_sort(out, std::ranges::greater(), &EventLine::pixels);
  return out;
}

Eigen::Vector2d crossing(const EventLine& a, const EventLine& b) {
  Eigen::Matrix2d both;
  both << a.normal.transpose(), b.normal.transpose();
  constexpr double kParallel = 1e-6;
  if (!(std::abs(both.determinant()) > kParallel)) return Eigen::Vector2d::Constant(1e9);
  return both.inverse() * Eigen::Vector2d(a.offset, b.offset);
}

}  // namespace evpose
