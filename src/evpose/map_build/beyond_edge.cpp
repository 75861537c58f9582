// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_build/beyond_edge.h"

#include <algorithm>
#include <cmath>

namespace evpose::map_build {
namespace {

/// Side of the plane that nearly all other points of the cloud lie on; 0 if there is none.
double side_of_the_rest(const SurfacePoints& surface, const FittedPlane& plane) {
  constexpr double kAway_m = 0.1, kNearlyAll = 0.9;
  double above = 0, below = 0;
  const std::size_t step = std::max<std::size_t>(1, surface.size() / 4000);
  for (std::size_t i = 0; i < surface.size(); i += step) {
    const double d = plane.distance(surface.position[i].cast<double>());
    above += d > kAway_m ? 1 : 0;
    below += d < -kAway_m ? 1 : 0;
  }
  if (above > kNearlyAll * (above + below)) return 1;
  return below > kNearlyAll * (above + below) ? -1 : 0;
}

}  // namespace

BeyondEdge::BeyondEdge(const SurfacePoints& surface, const Neighbours& tree, const FittedPlane& plane,
                       std::span<const View> views)
    : tree_(tree),
      plane_(plane),
      views_(views),
      noise_m_(noise_on(surface, plane)),
      free_side_(side_of_the_rest(surface, plane)) {}

bool BeyondEdge::surface_continues(const LineSegment& edge) const {
  constexpr int kProbes = 12;
  int hit = 0;
  const double reach_m = this->reach_m();
  for (int k = 0; k < kProbes; ++k)
    hit += tree_.any_within(probe(edge, (k + 0.5) / kProbes, 1.6 * reach_m), reach_m) ? 1 : 0;
  return hit > kProbes / 2;
}

bool BeyondEdge::something_stands_before(const LineSegment& edge) const {
  if (free_side_ == 0) return false;
  constexpr int kProbes = 8, kHeights = 6;
  constexpr double kHighest_m = 0.45;
  int hit = 0;
  const double reach_m = std::max(2 * plane_.spacing_m, 0.04), lowest_m = 2 * reach_m;
  for (int k = 0; k < kProbes; ++k) {
    const Eigen::Vector3d beyond = probe(edge, (k + 0.5) / kProbes, 1.5 * reach_m);
    bool stands = false;
    for (int h = 0; h < kHeights && !stands; ++h) {
      const double height_m = lowest_m + (kHighest_m - lowest_m) * h / (kHeights - 1);
      stands = tree_.any_within(beyond + free_side_ * height_m * plane_.normal, reach_m);
    }
    hit += stands ? 1 : 0;
  }
  return hit > kProbes / 2;
}

bool BeyondEdge::hidden_from_views(const LineSegment& edge) const {
  constexpr int kProbes = 8;
  const double margin_m = std::max({0.05, 3 * plane_.spacing_m, 5 * noise_m_});
  int hit = 0;
  for (int k = 0; k < kProbes; ++k)
    hit +=
        hidden_from_all(views_, probe(edge, (k + 0.5) / kProbes, 1.6 * reach_m()), plane_, margin_m) ? 1 : 0;
  return hit > kProbes / 2;
}

}  // namespace evpose::map_build
