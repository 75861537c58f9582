// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/eval/statistics.h"

#include <algorithm>
#include <cmath>

#include "evpose/core/error.h"

namespace evpose {

double quantile(const std::vector<double>& sorted, double share) {
  EVPOSE_CHECK(!sorted.empty() && share >= 0 && share <= 1);
  const double at = share * static_cast<double>(sorted.size() - 1);
  const auto below = static_cast<std::size_t>(at);
  const std::size_t above = std::min(below + 1, sorted.size() - 1);
  const double u = at - static_cast<double>(below);
  return sorted[below] + u * (sorted[above] - sorted[below]);
}

Statistics summarise(std::vector<double> values) {
  if (values.empty()) return {};
  std::sort(values.begin(), values.end());
  double sum = 0, sum_of_squares = 0;
  for (const double v : values) {
    sum += v;
    sum_of_squares += v * v;
  }
  const auto count = static_cast<double>(values.size());
  return {sum / count, quantile(values, 0.5), std::sqrt(sum_of_squares / count), quantile(values, 0.95),
          values.back()};
}

}  // namespace evpose
