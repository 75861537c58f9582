// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_build/neighbours.h"

#include <cmath>
#include <nanoflann.hpp>

namespace evpose::map_build {

struct Neighbours::Tree {
  struct Adaptor {
    std::span<const Eigen::Vector3f> points;
    std::size_t kdtree_get_point_count() const { return points.size(); }
    float kdtree_get_pt(std::size_t i, std::size_t k) const {
      return points[i][static_cast<Eigen::Index>(k)];
    }
    template <class Box>
    bool kdtree_get_bbox(Box&) const {
      return false;
    }
  };
  using Index = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, Adaptor>, Adaptor, 3,
                                                    std::uint32_t>;
  explicit Tree(std::span<const Eigen::Vector3f> points)
      : adaptor{points}, index(3, adaptor, nanoflann::KDTreeSingleIndexAdaptorParams(16)) {
    index.buildIndex();
  }
  Adaptor adaptor;
  Index index;
};

Neighbours::Neighbours(std::span<const Eigen::Vector3f> points) : tree_(std::make_unique<Tree>(points)) {}
Neighbours::~Neighbours() = default;

std::size_t Neighbours::nearest(const Eigen::Vector3f& p, std::span<std::uint32_t> indices,
                                std::span<float> squares) const {
  return tree_->index.knnSearch(p.data(), indices.size(), indices.data(), squares.data());
}

bool Neighbours::any_within(const Eigen::Vector3d& p, double reach_m) const {
  std::uint32_t index = 0;
  float square = 0;
  return nearest(p.cast<float>(), {&index, 1}, {&square, 1}) == 1 &&
         std::sqrt(static_cast<double>(square)) < reach_m;
}

void Neighbours::within(const Eigen::Vector3f& p, float radius_m, std::vector<std::uint32_t>& out) const {
  nanoflann::SearchParams unsorted;
  unsorted.sorted = false;
  std::vector<std::pair<std::uint32_t, float>> found;
  tree_->index.radiusSearch(p.data(), radius_m * radius_m, found, unsorted);
  out.clear();
  for (const auto& [index, square] : found) out.push_back(index);
}

}  // namespace evpose::map_build
