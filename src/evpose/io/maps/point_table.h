// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <functional>
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

/// Is given the rows of a file in order, a block at a time, the first of which may be empty. An error ends
/// the reading and becomes its own.
using PointBlocks = std::function<Status(const PointTable& block)>;
inline constexpr std::size_t kPointBlock = 65536;  ///< rows of a block at the most

/// All blocks that `read` gives as one table.
Expected<PointTable> joined_blocks(const std::function<Status(const PointBlocks&)>& read);

}  // namespace evpose
