// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/report/series.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>

#include "evpose/core/error.h"

namespace evpose {

Series thin(const Series& series, std::size_t points) {
  const std::size_t size = series.y.size();
  if (size <= points || points < 4) return series;
  const std::size_t stretches = points / 2 - 1;
  Series out;
  out.add(series.t.front(), series.y.front());
  for (std::size_t s = 0; s < stretches; ++s) {
    const std::size_t begin = 1 + s * (size - 2) / stretches, end = 1 + (s + 1) * (size - 2) / stretches;
    if (begin == end) continue;
    const auto first = series.y.begin() + static_cast<std::ptrdiff_t>(begin);
    const auto [low, high] = std::minmax_element(first, series.y.begin() + static_cast<std::ptrdiff_t>(end));
    const auto i = static_cast<std::size_t>(std::min(low, high) - series.y.begin());
    const auto j = static_cast<std::size_t>(std::max(low, high) - series.y.begin());
    out.add(series.t[i], series.y[i]);
    if (j != i) out.add(series.t[j], series.y[j]);
  }
  out.add(series.t.back(), series.y.back());
  return out;
}

std::vector<std::size_t> evenly_spaced_indices(std::size_t size, std::size_t count) {
  const std::size_t n = std::min(size, count);
  std::vector<std::size_t> out;
  out.reserve(n);
  for (std::size_t i = 0; i < n; ++i) out.push_back(n < 2 ? 0 : i * (size - 1) / (n - 1));
  return out;
}

LogHistogram log_histogram(const std::vector<double>& values, double low, double high, int bins_per_decade) {
  EVPOSE_CHECK(low > 0 && high >= low && bins_per_decade > 0);
  const double first = std::floor(std::log10(low) * bins_per_decade);
  const double last = std::floor(std::log10(high) * bins_per_decade) + 1;
  const auto bins = static_cast<std::size_t>(last - first);
  LogHistogram out;
  for (std::size_t i = 0; i <= bins; ++i)
    out.edges.push_back(std::pow(10.0, (first + static_cast<double>(i)) / bins_per_decade));
  out.shares.assign(bins, 0);
  if (values.empty()) return out;
  const double share = 1 / static_cast<double>(values.size());
  for (const double v : values) {
    const double at = std::floor(std::log10(std::clamp(v, low, high)) * bins_per_decade) - first;
    out.shares[static_cast<std::size_t>(std::clamp(at, 0.0, static_cast<double>(bins - 1)))] += share;
  }
  return out;
}

double rounded(double value, int digits) {
  char text[64];
  std::snprintf(text, sizeof text, "%.*g", digits, value);
  return std::strtod(text, nullptr);
}

std::string base64(std::string_view bytes) {
  constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  out.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t n = std::min<std::size_t>(3, bytes.size() - i);
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < 3; ++k)
      group = group << 8 | (k < n ? static_cast<std::uint8_t>(bytes[i + k]) : 0u);
    for (std::size_t k = 0; k < 4; ++k) out += k <= n ? kDigits[group >> (18 - 6 * k) & 63u] : '=';
  }
  return out;
}

}  // namespace evpose
