// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_build/contrast.h"

#include <Eigen/Geometry>
#include <cmath>

#include "evpose/map_build/strips.h"

namespace evpose::map_build {

std::int8_t contrast_of(const LineSegment& segment, const SurfacePoints& surface, const Neighbours& tree,
                        std::span<const std::uint8_t> brightness) {
  constexpr double kMixed = 2;        // noise: nearer to the edge points may be of either face
  constexpr double kWidth_m = 0.08;   // of the strips that are compared
  constexpr double kFewest = 10;      // points of a strip
  constexpr double kLeastStep = 6;    // grey levels of 250 that events could tell
  constexpr double kLeastSigmas = 4;  // of the difference of means
  if (segment.normal_b.isZero()) return 0;
  const double noise = surface.scale.noise_m, near_m = kMixed * noise, far_m = near_m + kWidth_m;
  const Eigen::Vector3d along = segment.tangent();
  struct Strip {
    Eigen::Vector3d across, over;  ///< out of the face at the edge; the face's normal
    double sum = 0, squares = 0, count = 0;
    double mean() const { return sum / count; }
    double variance() const { return (squares / count - mean() * mean()) / count; }
  };
  Strip strips[2] = {{segment.normal_a, along.cross(segment.normal_a)},
                     {segment.normal_b, along.cross(segment.normal_b)}};
  for_points_along(surface, tree, segment.begin, segment.end, far_m,
                   [&](std::uint32_t i, const auto& d, const auto&) {
                     for (Strip& strip : strips) {
                       const double inwards = -strip.across.dot(d);
                       if (inwards < near_m || inwards > far_m || std::abs(strip.over.dot(d)) > near_m)
                         continue;
                       const auto grey = static_cast<double>(brightness[i]);
                       strip.sum += grey, strip.squares += grey * grey, strip.count += 1;
                     }
                   });
  if (std::min(strips[0].count, strips[1].count) < kFewest) return 0;
  const double step = strips[1].mean() - strips[0].mean();
  const double sigma = std::sqrt(std::max(strips[0].variance() + strips[1].variance(), 0.0));
  if (std::abs(step) < std::max(kLeastStep, kLeastSigmas * sigma)) return 0;
  return step > 0 ? 1 : -1;
}

}  // namespace evpose::map_build
