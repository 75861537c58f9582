// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/temporal_field.h"

#include <algorithm>
#include <cmath>

namespace evpose {
namespace {

std::uint32_t newest(const TimeSurface& surface, int x, int y, FieldPolarity polarity) {
  if (polarity == FieldPolarity::off) return surface.last(x, y, Polarity::off);
  if (polarity == FieldPolarity::on) return surface.last(x, y, Polarity::on);
  return std::max(surface.last(x, y, Polarity::off), surface.last(x, y, Polarity::on));
}

float decayed(std::uint32_t last, std::uint32_t now_us, float rate) {
  if (last == 0) return 0;
  const float age = last < now_us ? static_cast<float>(now_us - last) : 0.0F;
  return std::exp(-age * rate);
}

/// Values and slopes of the four cubic B-spline pieces at u in [0, 1).
void spline_weights(double u, double w[4], double d[4]) {
  const double v = 1 - u;
  w[0] = v * v * v / 6;
  w[1] = (4 - 6 * u * u + 3 * u * u * u) / 6;
  w[2] = (4 - 6 * v * v + 3 * v * v * v) / 6;
  w[3] = u * u * u / 6;
  d[0] = -0.5 * v * v;
  d[1] = -2 * u + 1.5 * u * u;
  d[2] = 2 * v - 1.5 * v * v;
  d[3] = 0.5 * u * u;
}

}  // namespace

FieldSample sample_field(const TimeSurface& surface, const Eigen::Vector2d& pixel, std::uint32_t now_us,
                         double decay_us, FieldKernel kernel, FieldPolarity polarity) {
  const double fx = std::floor(pixel.x()), fy = std::floor(pixel.y());
  const int x0 = static_cast<int>(fx), y0 = static_cast<int>(fy);
  const double ux = pixel.x() - fx, uy = pixel.y() - fy;
  const float rate = static_cast<float>(1 / decay_us);
  double wx[4] = {0, 1 - ux, ux, 0}, dx[4] = {0, -1, 1, 0};
  double wy[4] = {0, 1 - uy, uy, 0}, dy[4] = {0, -1, 1, 0};
  int first = 1, last = 2;
  if (kernel == FieldKernel::spline) {
    spline_weights(ux, wx, dx);
    spline_weights(uy, wy, dy);
    first = 0, last = 3;
  }
  FieldSample out;
  for (int j = first; j <= last; ++j)
    for (int i = first; i <= last; ++i) {
      const double t = decayed(newest(surface, x0 + i - 1, y0 + j - 1, polarity), now_us, rate);
      out.value += wx[i] * wy[j] * t;
      out.gradient.x() += dx[i] * wy[j] * t;
      out.gradient.y() += wx[i] * dy[j] * t;
    }
  return out;
}

}  // namespace evpose
