// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/relocalization/place_cache.h"

#include <algorithm>
#include <cstddef>
#include <span>

namespace evpose {
namespace {

constexpr std::size_t kMost = 3;
constexpr double kCoarser = 1.5;  // than an index over the box alone

/// FNV-1a.
class Fingerprint {
 public:
  template <typename T>
  void add(const T& value) {
    for (const std::byte b : std::as_bytes(std::span(&value, 1)))
      hash_ = (hash_ ^ static_cast<std::uint64_t>(b)) * 0x100000001B3ULL;
  }
  std::uint64_t value() const { return hash_; }

 private:
  std::uint64_t hash_ = 0xCBF29CE484222325ULL;
};

/// Of what decides which contours are seen.
std::uint64_t fingerprint(const ContourMap& map) {
  Fingerprint out;
  for (int k = 0; k < 3; ++k) out.add(map.anchor[k]);
  out.add(map.points.size());
  for (const ContourPoint& p : map.points)
    for (int k = 0; k < 3; ++k) out.add(p.position[k]);
  for (const Eigen::Vector3f& v : map.occluders.vertices)
    for (int k = 0; k < 3; ++k) out.add(v[k]);
  return out.value();
}

bool same_view(const VisibleSetConfig& a, const VisibleSetConfig& b) {
  return a.near_m == b.near_m && a.far_m == b.far_m && a.grazing_sin == b.grazing_sin &&
         a.occlusion == b.occlusion;
}

}  // namespace

std::shared_ptr<const PlaceIndex> PlaceCache::over(const ContourIndex& index, const VisibleSetConfig& config,
                                                   const Eigen::AlignedBox3d& box) {
  const std::uint64_t map = fingerprint(index.map());
  const double coarsest_m = kCoarser * PlaceIndex::edge_m_of(box);
  const std::lock_guard lock(mutex_);
  const auto known = std::find_if(entries_.begin(), entries_.end(), [&](const Entry& e) {
    return e.map == map && same_view(e.config, config) && e.box.contains(box) &&
           e.index->edge_m() <= coarsest_m;
  });
  if (known != entries_.end()) return known->index;
  entries_.push_front({map, config, box, std::make_shared<const PlaceIndex>(index, config, box)});
  if (entries_.size() > kMost) entries_.pop_back();
  return entries_.front().index;
}

}  // namespace evpose
