// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/calibrate/line_lattice.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

namespace evpose {
namespace {

constexpr double kAgrees_px = 4;  // of a line from where its number has it: lenses bend lines
constexpr double kAgrees = 0.15;  // and of the distance between two
constexpr int kLeastLines = 4;
constexpr int kLargestGap = 3;    // between two lines that are next to each other in the image
constexpr double kMissing = 0.4;  // of a line that agrees: what one that is not there costs
constexpr std::size_t kMostOfFamily = 16;
constexpr double kFamily = 0.4;  // rad that a normal may be off the family's

struct Place {
  EventLine line;
  double at = 0;  ///< along the line across the family, px
};

/// at = (a + b number) / (1 + c number).
struct Spacing {
  double a = 0, b = 0, c = 0;
  double at(double number) const { return (a + b * number) / (1 + c * number); }
  double number(double at) const { return (at - a) / (b - c * at); }
};

std::optional<Spacing> spacing_of(const std::array<double, 3>& at, const std::array<int, 3>& number) {
  Eigen::Matrix3d A;
  Eigen::Vector3d b;
  for (int i = 0; i < 3; ++i) {
    const auto k = static_cast<std::size_t>(i);
    A.row(i) << 1, number[k], -number[k] * at[k];
    b(i) = at[k];
  }
  if (!(std::abs(A.determinant()) > 1e-9)) return {};
  const Eigen::Vector3d x = A.inverse() * b;
  return Spacing{x(0), x(1), x(2)};
}

struct Numbering {
  double score = 0;
  std::vector<std::optional<int>> numbers;  ///< of each place
};

Numbering judged(std::span<const Place> places, const Spacing& spacing) {
  Numbering out;
  out.numbers.resize(places.size());
  std::optional<int> first, last;
  int agree = 0;
  for (std::size_t i = 0; i < places.size(); ++i) {
    const double number = spacing.number(places[i].at);
    if (!(std::abs(number) < 1e3) || !(1 + spacing.c * number > 0.2)) continue;
    const auto whole = static_cast<int>(std::lround(number));
    const double step = std::abs(spacing.at(whole + 0.5) - spacing.at(whole - 0.5));
    if (std::abs(spacing.at(whole) - places[i].at) > std::min(kAgrees_px, kAgrees * step)) continue;
    if (last && whole <= *last) continue;
    if (!first) first = whole;
    last = whole;
    out.numbers[i] = whole;
    ++agree;
  }
  if (agree == 0) return out;
  out.score = agree - kMissing * (*last - *first + 1 - agree);
  return out;
}

/// The lines that cross `across` in one direction, in their order along it.
std::vector<Place> places_of(std::span<const EventLine> lines, const Eigen::Vector2d& towards,
                             const Eigen::Vector2d& middle) {
  // The family's direction is that of most pixels.
  double most = 0;
  Eigen::Vector2d normal = towards;
  const auto angle_to = [](const EventLine& line, const Eigen::Vector2d& n) {
    return std::acos(std::min(1.0, std::abs(line.normal.dot(n))));
  };
  for (const EventLine& candidate : lines) {
    if (angle_to(candidate, towards) > M_PI / 4) continue;
    double sum = 0;
    for (const EventLine& line : lines)
      if (angle_to(line, candidate.normal) < 0.5 * kFamily) sum += line.pixels;
    if (sum > most) most = sum, normal = candidate.normal;
  }
  if (normal.dot(towards) < 0) normal = -normal;
  std::vector<Place> out;
  for (const EventLine& line : lines) {
    const double along = line.normal.dot(normal);
    if (angle_to(line, normal) > kFamily || out.size() == kMostOfFamily) continue;
    out.push_back({line, (line.offset - line.normal.dot(middle)) / along});
  }
  std::ranges::sort(out, {}, &Place::at);
  return out;
}

}  // namespace

std::vector<NumberedLine> number_lines(std::span<const EventLine> lines, const Eigen::Vector2d& towards,
                                       const Eigen::Vector2d& middle) {
  const std::vector<Place> places = places_of(lines, towards, middle);
  Numbering best;
  for (std::size_t i = 0; i < places.size(); ++i)
    for (std::size_t j = i + 1; j < places.size(); ++j)
      for (std::size_t k = j + 1; k < places.size(); ++k)
        for (int first = 1; first <= kLargestGap; ++first)
          for (int second = 1; second <= kLargestGap; ++second) {
            const auto spacing =
                spacing_of({places[i].at, places[j].at, places[k].at}, {0, first, first + second});
            if (!spacing) continue;
            Numbering numbering = judged(places, *spacing);
            if (numbering.score > best.score) best = std::move(numbering);
          }
  std::vector<NumberedLine> out;
  for (std::size_t i = 0; i < best.numbers.size(); ++i)
    if (best.numbers[i]) out.push_back({places[i].line, *best.numbers[i]});
  if (out.size() < kLeastLines) return {};
  const int least = out.front().number;
  for (NumberedLine& line : out) line.number -= least;
  return out;
}

}  // namespace evpose
