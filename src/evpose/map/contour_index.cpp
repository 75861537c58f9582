// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map/contour_index.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <unordered_set>

namespace evpose {
namespace {

constexpr int kBlockCubes = 8;                 // a block is 8 x 8 x 8 cubes
constexpr float kOccluderCubes = 4;            // triangles are gathered in boxes of 4 x 4 x 4 cubes
constexpr std::uint32_t kMostOccluders = 256;  // triangles in one group

/// Key of a short stretch of a contour, `length` long, a quarter of it wide, in its direction.
std::uint64_t stretch_of(const ContourPoint& p, float length) {
  int axis = 0;
  p.tangent.cwiseAbs().maxCoeff(&axis);
  const float sign = p.tangent[axis] < 0 ? -1.0F : 1.0F;
  std::uint64_t key = static_cast<std::uint64_t>(axis);
  const auto mix = [&key](float v) {
    key = (key ^ static_cast<std::uint64_t>(static_cast<std::int64_t>(std::floor(v)))) * 0x9E3779B97F4A7C15u;
    key ^= key >> 29;
  };
  for (int k = 0; k < 3; ++k) {
    mix(std::clamp(p.position[k] / (k == axis ? length : 0.25F * length), -1e15F, 1e15F));
    if (k != axis) mix(4 * sign * p.tangent[k] + 0.5F);
  }
  return key;
}

std::int64_t key_of(const Eigen::Vector3f& p, float edge) {
  const auto coordinate = [edge](float v) {
    return static_cast<std::int64_t>(std::clamp(std::floor(v / edge), -1048576.0F, 1048575.0F)) & 0x1FFFFF;
  };
  return (coordinate(p.z()) << 42) | (coordinate(p.y()) << 21) | coordinate(p.x());
}

struct Sphere {
  Eigen::Vector3f centre;
  float radius;
};

template <class Position>
Sphere bound(std::uint32_t begin, std::uint32_t end, const Position& position) {
  Eigen::Vector3f low = position(begin), high = low;
  for (std::uint32_t i = begin; i < end; ++i) {
    low = low.cwiseMin(position(i));
    high = high.cwiseMax(position(i));
  }
  Sphere s{0.5F * (low + high), 0};
  for (std::uint32_t i = begin; i < end; ++i) s.radius = std::max(s.radius, (position(i) - s.centre).norm());
  return s;
}

}  // namespace

ContourIndex::ContourIndex(const ContourMap& map, double cube_m)
    : map_(&map), cube_m_(static_cast<float>(cube_m)) {
  const std::size_t n = map.points.size();
  struct Keys {
    std::int64_t block, cube;
  };
  std::vector<Keys> keys(n);
  for (std::size_t i = 0; i < n; ++i) {
    const Eigen::Vector3f& p = map.points[i].position;
    keys[i] = {key_of(p, cube_m_ * kBlockCubes), key_of(p, cube_m_)};
  }
  for (std::uint32_t i = 0; i < n; ++i)
    if (!is_view_dependent(map.points[i].kind)) order_.push_back(i);
  std::sort(order_.begin(), order_.end(), [&keys](std::uint32_t a, std::uint32_t b) {
    if (keys[a].block != keys[b].block) return keys[a].block < keys[b].block;
    if (keys[a].cube != keys[b].cube) return keys[a].cube < keys[b].cube;
    return a < b;
  });
  const auto position = [&](std::uint32_t i) -> const Eigen::Vector3f& {
    return map_->points[order_[i]].position;
  };
  const auto count = static_cast<std::uint32_t>(order_.size());
  for (std::uint32_t begin = 0; begin < count;) {
    std::uint32_t block_end = begin;
    while (block_end < count && keys[order_[block_end]].block == keys[order_[begin]].block) ++block_end;
    const Sphere whole = bound(begin, block_end, position);
    const auto first_cube = static_cast<std::uint32_t>(cubes_.size());
    for (std::uint32_t i = begin; i < block_end;) {
      std::uint32_t end = i;
      while (end < block_end && keys[order_[end]].cube == keys[order_[i]].cube) ++end;
      const Sphere s = bound(i, end, position);
      cubes_.push_back({s.centre, s.radius, i, end, {}});
      order_coarse_to_fine(cubes_.back());
      i = end;
    }
    blocks_.push_back({keys[order_[begin]].block, first_cube, static_cast<std::uint32_t>(cubes_.size()),
                       whole.centre, whole.radius});
    begin = block_end;
  }
  group_occluders();
}

void ContourIndex::order_coarse_to_fine(Cube& cube) {
  const auto at = [this](std::uint32_t i) { return order_.begin() + static_cast<std::ptrdiff_t>(i); };
  std::uint32_t done = cube.begin;
  float spacing = kCoarsest_m;
  std::unordered_set<std::uint64_t> taken;
  for (std::uint32_t& end : cube.level_end) {
    taken.clear();
    for (auto i = at(cube.begin); i != at(done); ++i) taken.insert(stretch_of(map_->points[*i], spacing));
    const auto rest = std::stable_partition(at(done), at(cube.end), [&](std::uint32_t number) {
      return taken.insert(stretch_of(map_->points[number], spacing)).second;
    });
    end = done = static_cast<std::uint32_t>(rest - order_.begin());
    spacing *= 0.5F;
  }
}

std::uint32_t ContourIndex::Cube::end_for(float spacing_m) const {
  float spacing = kCoarsest_m;
  for (const std::uint32_t e : level_end) {
    if (spacing <= spacing_m) return e;
    spacing *= 0.5F;
  }
  return end;
}

void ContourIndex::group_occluders() {
  const TriangleMesh& mesh = map_->occluders;
  const auto n = static_cast<std::uint32_t>(mesh.triangles.size());
  const auto corner = [&mesh](std::uint32_t triangle, std::size_t k) -> const Eigen::Vector3f& {
    return mesh.vertices[mesh.triangles[triangle][k]];
  };
  std::vector<std::int64_t> keys(n);
  for (std::uint32_t i = 0; i < n; ++i)
    keys[i] = key_of((corner(i, 0) + corner(i, 1) + corner(i, 2)) / 3, cube_m_ * kOccluderCubes);
  occluder_order_.resize(n);
  std::iota(occluder_order_.begin(), occluder_order_.end(), 0u);
  std::sort(occluder_order_.begin(), occluder_order_.end(), [&keys](std::uint32_t a, std::uint32_t b) {
    return keys[a] != keys[b] ? keys[a] < keys[b] : a < b;
  });
  for (std::uint32_t begin = 0, end = 0; begin < n; begin = end) {
    while (end < n && end - begin < kMostOccluders &&
           keys[occluder_order_[end]] == keys[occluder_order_[begin]])
      ++end;
    const Sphere s = bound(3 * begin, 3 * end, [&](std::uint32_t i) -> const Eigen::Vector3f& {
      return corner(occluder_order_[i / 3], i % 3);
    });
    occluders_.push_back({s.centre, s.radius, begin, end});
  }
}

void ContourIndex::append_cubes_within(const Eigen::Vector3d& centre_map, double radius_m,
                                       std::vector<std::uint32_t>& out) const {
  const Eigen::Vector3f centre = (centre_map - map_->anchor).cast<float>();
  const auto radius = static_cast<float>(radius_m);
  // Only the blocks whose keys lie around the sphere are looked up; few enough of them to ask for each.
  const float edge = cube_m_ * kBlockCubes;
  const Eigen::Vector3f low = ((centre.array() - radius) / edge).floor(),
                        high = ((centre.array() + radius) / edge).floor();
  const Eigen::Vector3f count = high - low + Eigen::Vector3f::Ones();
  const auto take = [&](const BlockRange& b) {
    if ((b.centre - centre).norm() > radius + b.radius) return;
    for (std::uint32_t c = b.begin; c < b.end; ++c)
      if ((cubes_[c].centre - centre).norm() <= radius + cubes_[c].radius) out.push_back(c);
  };
  if (count.prod() > static_cast<float>(blocks_.size())) {
    for (const auto& b : blocks_) take(b);
    return;
  }
  const std::size_t first = out.size();
  for (float z = low.z(); z <= high.z(); ++z)
    for (float y = low.y(); y <= high.y(); ++y)
      for (float x = low.x(); x <= high.x(); ++x) {
        const std::int64_t key = key_of(Eigen::Vector3f(x + 0.5F, y + 0.5F, z + 0.5F) * edge, edge);
        const auto it = std::lower_bound(blocks_.begin(), blocks_.end(), key,
                                         [](const BlockRange& b, std::int64_t k) { return b.key < k; });
        if (it != blocks_.end() && it->key == key) take(*it);
      }
  std::sort(out.begin() + static_cast<std::ptrdiff_t>(first), out.end());
}

}  // namespace evpose
