// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "evpose/core/error.h"
#include "evpose/io/files/new_folder.h"
#include "evpose/map/cloud_tile.h"
#include "evpose/map/point_cloud.h"

namespace evpose {

/// A cloud that is cut into tiles, each of them a job by itself: a folder with plan.yaml, settings.yaml, a
/// cloud for each tile, and beside it the tile's map once that is built.
struct TilePlan {
  std::string folder;
  std::string cloud;                                 ///< path of the whole cloud
  Eigen::Vector3d anchor = Eigen::Vector3d::Zero();  ///< of all tiles, map frame
  std::vector<CloudTile> tiles;
  std::vector<std::size_t> points;  ///< of each tile's cloud

  std::string cloud_of(std::size_t tile) const;  ///< path
  std::string map_of(std::size_t tile) const;    ///< path
  std::string settings() const { return folder + "/settings.yaml"; }
};

/// Errors: not such a folder, of another version, or not what was written there.
Expected<TilePlan> read_tile_plan(const std::string& folder);

/// The points that a tile sees, relative to the anchor, as the whole cloud had them. Errors: another number
/// of points than the plan says, not what was written there.
Expected<PointCloud> read_tile_cloud(const TilePlan& plan, std::size_t tile);

/// Cuts a cloud into the clouds of its tiles, point by point.
class TileCloudWriter {
 public:
  /// `plan` has everything but the numbers of points; `brightness`: each point has one. `settings` goes to
  /// settings.yaml as it is. Errors: the folder exists; it cannot be written.
  static Expected<TileCloudWriter> create(TilePlan plan, bool brightness, const std::string& settings);

  /// Points in the order of the cloud.
  Status add(const PointCloud& block);
  /// Only now there is a folder of that name. The plan with the numbers of points.
  Expected<TilePlan> commit();

 private:
  TileCloudWriter(TilePlan plan, bool brightness, NewFolder folder);
  Status flush(std::size_t tile);

  TilePlan plan_;
  bool brightness_;
  NewFolder folder_;
  std::vector<std::string> rows_;  ///< of each tile, not yet written
};

}  // namespace evpose
