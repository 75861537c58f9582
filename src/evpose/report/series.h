// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace evpose {

/// Values over time.
struct Series {
  std::vector<double> t, y;

  void add(double time, double value) {
    t.push_back(time);
    y.push_back(value);
  }
};

/// At most about `points` of the points: first, last, and the least and greatest value of each stretch
/// between, so that no peak is lost.
Series thin(const Series& series, std::size_t points);

/// At most `count` of the indices 0 .. size-1, evenly, first and last among them.
std::vector<std::size_t> evenly_spaced_indices(std::size_t size, std::size_t count);

/// Shares of the values per bin; the bins have equal width on a log axis.
struct LogHistogram {
  std::vector<double> edges;   ///< one more than shares
  std::vector<double> shares;  ///< sum 1, unless there is no value
};
/// Values outside [low, high] count in the outermost bins. low > 0.
LogHistogram log_histogram(const std::vector<double>& values, double low, double high, int bins_per_decade);

/// To so many significant digits: what is beyond is noise, and makes files long.
double rounded(double value, int digits);

std::string base64(std::string_view bytes);

}  // namespace evpose
