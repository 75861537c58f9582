// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>

#include "evpose/map/place_table.h"
#include "evpose/relocalization/place_index.h"

namespace evpose {

/// The last place indices that searches asked for: one takes seconds of a core. May be shared by threads; one
/// that asks while another makes an index waits.
class PlaceCache {
 public:
  PlaceCache() = default;
  /// With what a map file keeps, from which its index is made in a tenth of the time.
  explicit PlaceCache(PlaceTable kept);
  /// With the indices that the other has now.
  PlaceCache(const PlaceCache& other);
  PlaceCache& operator=(const PlaceCache&) = delete;

  /// Of places over the box at least, divided at least nearly as finely as its own would be.
  std::shared_ptr<const PlaceIndex> over(const ContourIndex& index, const VisibleSetConfig& config,
                                         const Eigen::AlignedBox3d& box);

 private:
  struct Entry {
    std::uint64_t map;  ///< its fingerprint
    VisibleSetConfig config;
    Eigen::AlignedBox3d box;
    std::shared_ptr<const PlaceIndex> index;
  };
  bool keeps(std::uint64_t map, const VisibleSetConfig& config, const Eigen::AlignedBox3d& box) const;

  std::optional<PlaceTable> kept_;
  mutable std::mutex mutex_;
  std::deque<Entry> entries_;
};

}  // namespace evpose
