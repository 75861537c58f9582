// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>
#include <vector>

#include "evpose/core/error.h"
#include "evpose/io/hdf5/hdf5_file.h"
#include "evpose/io/maps/map_h5_pages.h"

namespace evpose {

/// A map file that is read by place, page by page, however large it is. May be asked from any thread, from
/// one at a time.
class MapPages {
 public:
  /// Errors: as of read_map_h5().
  static Expected<MapPages> open(const std::string& path);

  /// False: the map has no pages, it is read as a whole.
  bool divided() const { return pages_.size() > 1; }
  /// The pages that reach within `radius_m` of the place, horizontally, as one map that is complete to track
  /// against and knows its points' numbers in the whole. It may be empty. Errors: as of read_map_h5().
  Expected<std::shared_ptr<const ContourMap>> around(const Eigen::Vector3d& place_map, double radius_m) const;

 private:
  MapPages(Hdf5File file, std::vector<MapFilePage> pages)
      : file_(std::move(file)), pages_(std::move(pages)) {}

  Hdf5File file_;
  std::vector<MapFilePage> pages_;
};

}  // namespace evpose
