// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

namespace evpose {

/// Summary of a series, in the unit of the series.
struct Statistics {
  double mean = 0, median = 0, rmse = 0, p95 = 0, max = 0;
};

/// All zero for an empty series.
Statistics summarise(std::vector<double> values);

/// The value below which `share` (0..1) of the series lies, linear between neighbours. `sorted`: ascending,
/// not empty.
double quantile(const std::vector<double>& sorted, double share);

}  // namespace evpose
