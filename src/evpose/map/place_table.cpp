// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map/place_table.h"

#include <cstddef>
#include <span>

namespace evpose {
namespace {

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

}  // namespace

std::uint64_t view_fingerprint(const ContourMap& map) {
  Fingerprint out;
  for (int k = 0; k < 3; ++k) out.add(map.anchor[k]);
  out.add(map.points.size());
  for (const ContourPoint& p : map.points)
    for (int k = 0; k < 3; ++k) out.add(p.position[k]);
  for (const Eigen::Vector3f& v : map.occluders.vertices)
    for (int k = 0; k < 3; ++k) out.add(v[k]);
  return out.value();
}

}  // namespace evpose
