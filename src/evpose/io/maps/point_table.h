// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace evpose {

/// Columns of numbers by name, as point files hold them.
struct PointTable {
  std::vector<std::string> names;
  std::vector<std::vector<double>> columns;        ///< one for each name, all of equal length
  std::optional<std::array<double, 3>> viewpoint;  ///< where a scanner stood, if the file says so

  std::size_t rows() const { return columns.empty() ? 0 : columns.front().size(); }
  /// The column, or nullptr.
  const std::vector<double>* find(const std::string& name) const {
    for (std::size_t i = 0; i < names.size(); ++i)
      if (names[i] == name) return &columns[i];
    return nullptr;
  }
};

}  // namespace evpose
