// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/bench/experiments/arc_corners.h"

#include <algorithm>
#include <limits>

namespace evpose::experiments {
namespace {

constexpr TimeNs kBurst = 50 * kNsPerMs;
constexpr TimeNs kNever = std::numeric_limits<TimeNs>::min() / 2;

struct Circle {
  int radius, shortest, longest;
  std::vector<std::array<int, 2>> pixels;  ///< one beside the next
};

/// One eighth after the other of the pixels that a circle is drawn with.
const std::array<Circle, 2>& circles() {
  static const std::array<Circle, 2> both{
      Circle{3,
             3,
             6,
             {{0, 3},
              {1, 3},
              {2, 2},
              {3, 1},
              {3, 0},
              {3, -1},
              {2, -2},
              {1, -3},
              {0, -3},
              {-1, -3},
              {-2, -2},
              {-3, -1},
              {-3, 0},
              {-3, 1},
              {-2, 2},
              {-1, 3}}},
      Circle{4, 4, 8, {{0, 4},   {1, 4},  {2, 3},  {3, 2},  {4, 1},   {4, 0},   {4, -1},
                       {3, -2},  {2, -3}, {1, -4}, {0, -4}, {-1, -4}, {-2, -3}, {-3, -2},
                       {-4, -1}, {-4, 0}, {-4, 1}, {-3, 2}, {-2, 3},  {-1, 4}}}};
  return both;
}

}  // namespace

bool has_corner_arc(const std::vector<TimeNs>& times, int shortest, int longest) {
  const auto count = static_cast<int>(times.size());
  const auto at = [&](int k) { return times[static_cast<std::size_t>((k % count + count) % count)]; };
  const auto newest = static_cast<int>(std::max_element(times.begin(), times.end()) - times.begin());
  int left = newest - 1, right = newest + 1, length = 1;
  TimeNs oldest = at(newest);   // of the arc
  TimeNs reached = at(newest);  // oldest of the pixels up to `left` and `right`
  for (int k = 2; k <= count; ++k) {
    const TimeNs next = std::max(at(left), at(right));
    at(right) >= at(left) ? ++right : --left;
    reached = std::min(reached, next);
    if (k > shortest && next < oldest) continue;
    length = k;
    oldest = reached;
  }
  return (length >= shortest && length <= longest) ||
         (length >= count - longest && length <= count - shortest);
}

ArcCorners::ArcCorners(ImageSize size) : size_(size) {
  const auto count = static_cast<std::size_t>(size.width) * static_cast<std::size_t>(size.height);
  for (auto* times : {&begun_, &last_})
    for (auto& of_polarity : *times) of_polarity.assign(count, kNever);
}

bool ArcCorners::is_corner(TimeNs t, int x, int y, bool on) {
  const auto pixel = [&](int column, int row) {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(size_.width) +
           static_cast<std::size_t>(column);
  };
  const std::size_t here = pixel(x, y);
  const TimeNs before = last_[on][here];
  last_[on][here] = t;
  if (t - before < kBurst && before > last_[!on][here]) return false;
  begun_[on][here] = t;
  if (!size_.contains({x, y}, circles()[1].radius)) return false;
  return std::all_of(circles().begin(), circles().end(), [&](const Circle& circle) {
    std::vector<TimeNs> times;
    for (const auto& [dx, dy] : circle.pixels) times.push_back(begun_[on][pixel(x + dx, y + dy)]);
    return has_corner_arc(times, circle.shortest, circle.longest);
  });
}

}  // namespace evpose::experiments
