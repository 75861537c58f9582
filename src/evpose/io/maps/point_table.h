// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "evpose/core/error.h"

namespace evpose {

/// Kinds of files that may hold points or contours.
enum class PointFileKind { ply, pcd, las, hdf5, other };

/// By the first bytes, then the extension. Errors: no such file, an empty one.
Expected<PointFileKind> point_file_kind(const std::string& path);

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
