// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/light/pixel_rays.h"

#include <algorithm>
#include <cmath>

namespace evpose::sim {

Expected<std::vector<PixelRay>> pixel_rays(const Camera& camera, double blur_px) {
  constexpr double kFlattest = 0.0175;                         // cosine of 89 degrees
  const double width = std::sqrt(1 + 12 * blur_px * blur_px);  // a box of width w has the variance w^2 / 12
  const ImageSize size = camera.size();
  std::vector<PixelRay> rays;
  rays.reserve(static_cast<std::size_t>(size.width) * size.height);
  bool seen = true;
  const auto along = [&](double x, double y) -> Eigen::Vector2d {
    const auto ray = camera.unproject({x, y});
    seen = seen && ray && ray->z() > kFlattest;
    if (!seen) return Eigen::Vector2d::Zero();
    return ray->head<2>() / ray->z();
  };
  for (int y = 0; y < size.height && seen; ++y) {
    for (int x = 0; x < size.width; ++x) {
      rays.push_back(
          {along(x, y).cast<float>(), (width * (along(x + 0.5, y) - along(x - 0.5, y))).cast<float>(),
           (width * (along(x, y + 0.5) - along(x, y - 0.5))).cast<float>(), static_cast<float>(width)});
    }
  }
  if (!seen)
    return Error{
        "camera",
        "some pixels look beyond 89 degrees from the optical axis, or the lens model has no ray there",
        "use a longer focal length or less distortion"};
  return rays;
}

float fraction_above(float level, Eigen::Vector2f slope) {
  float a = std::abs(slope.x()), b = std::abs(slope.y());
  if (a < b) std::swap(a, b);
  if (!(a > 0)) return level > 0 ? 1.0F : 0.0F;
  level /= a;
  b /= a;
  // The sum of two uniform distributions of widths 1 and b.
  if (level >= 0.5F * (1 + b)) return 1;
  if (level <= -0.5F * (1 + b)) return 0;
  if (std::abs(level) <= 0.5F * (1 - b)) return 0.5F + level;
  const float tip = 0.5F * (1 + b) - std::abs(level);  // to the corner
  const float rest = 0.5F * tip * tip / b;
  return level > 0 ? 1 - rest : rest;
}

}  // namespace evpose::sim
