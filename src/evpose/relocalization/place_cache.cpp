// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/relocalization/place_cache.h"

#include <algorithm>
#include <utility>

namespace evpose {
namespace {

constexpr std::size_t kMost = 3;
constexpr double kCoarser = 1.5;  // than an index over the box alone

bool same_view(const VisibleSetConfig& a, const VisibleSetConfig& b) {
  return a.near_m == b.near_m && a.far_m == b.far_m && a.grazing_sin == b.grazing_sin &&
         a.occlusion == b.occlusion;
}

}  // namespace

std::shared_ptr<const PlaceIndex> PlaceCache::over(const ContourIndex& index, const VisibleSetConfig& config,
                                                   const Eigen::AlignedBox3d& box) {
  const std::uint64_t map = view_fingerprint(index.map());
  const double coarsest_m = kCoarser * PlaceIndex::edge_m_of(box);
  const std::lock_guard lock(mutex_);
  const auto known = std::find_if(entries_.begin(), entries_.end(), [&](const Entry& e) {
    return e.map == map && same_view(e.config, config) && e.box.contains(box) &&
           e.index->edge_m() <= coarsest_m;
  });
  if (known != entries_.end()) return known->index;
  if (keeps(map, config, box))
    entries_.push_front({map, config, kept_->box, std::make_shared<const PlaceIndex>(index, *kept_)});
  else
    entries_.push_front({map, config, box, std::make_shared<const PlaceIndex>(index, config, box)});
  if (entries_.size() > kMost) entries_.pop_back();
  return entries_.front().index;
}

PlaceCache::PlaceCache(PlaceTable kept) : kept_(std::move(kept)) {}

PlaceCache::PlaceCache(const PlaceCache& other) : kept_(other.kept_) {
  const std::lock_guard lock(other.mutex_);
  entries_ = other.entries_;
}

/// Whether what is kept is of this map and view, over the box and as finely.
bool PlaceCache::keeps(std::uint64_t map, const VisibleSetConfig& config,
                       const Eigen::AlignedBox3d& box) const {
  return kept_ && kept_->view == map && config.occlusion && kept_->near_m == config.near_m &&
         kept_->far_m == config.far_m && kept_->grazing_sin == config.grazing_sin &&
         kept_->box.contains(box) &&
         static_cast<double>(kept_->looked_at.size()) == PlaceIndex::counts_of(kept_->box).prod() &&
         PlaceIndex::edge_m_of(kept_->box) <= kCoarser * PlaceIndex::edge_m_of(box);
}

}  // namespace evpose
