// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "evpose/sim/light/surfaces.h"

namespace evpose::sim {

/// A light map that gets finer where its light changes fast: at the feet of things and at the rims of
/// shadows. It starts as the coarse map, interpolated on a finer grid; the cells of the coarse one are the
/// unit in which texels are computed anew.
class LightRefinement {
 public:
  /// Refines `map` in place and keeps a reference. `finest_m`: wanted distance of texels. Does nothing where
  /// the map is as fine as that.
  LightRefinement(LightMap& map, double finest_m);

  /// Wants the cell around a point of the plane, along the map's axes, where something may stand that no
  /// coarse texel sees.
  void want_cell_at(const Eigen::Vector2d& at);
  /// Texels to be computed anew: those of wanted cells, and of cells around whose rim light differs by more
  /// than a fifth. Empty when there is nothing left to do.
  std::vector<std::uint32_t> next_texels();

 private:
  std::size_t cell(int column, int row) const { return static_cast<std::size_t>(row) * columns_ + column; }
  bool is_uneven(int column, int row) const;
  std::vector<std::size_t> changed_cells() const;

  LightMap& map_;
  int parts_ = 1;                           // texels along a side of a cell
  int columns_ = 0, rows_ = 0;              // cells
  std::vector<bool> wanted_, done_, fine_;  // cells, cells, texels
  std::vector<float> peak_;                 // of each channel, lux
  bool started_ = false;                    // texels have been asked for
  std::vector<std::size_t> latest_;         // cells that were last computed anew
};

}  // namespace evpose::sim
