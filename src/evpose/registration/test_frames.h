// SPDX-License-Identifier: BSD-3-Clause
// Frames of one straight edge whose place is known, as a camera averages their light over pixels and
// exposure.
#pragma once

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "evpose/camera/frame.h"
#include "evpose/registration/contour_view.h"

namespace evpose::test_frames {

inline constexpr ImageSize kFrameSize{160, 120};
inline constexpr TimeNs kFrameExposure = 10 * kNsPerMs;

/// A line at this distance from the origin along its normal, in the middle of the exposure.
struct TestLine {
  double angle = 0.3, distance_px = 90, speed_px_s = 0, acceleration_px_s2 = 0;
  double dark = 0.1, bright = 0.6;  ///< luminance behind and ahead, along the normal
  Eigen::Vector2d normal() const { return {std::cos(angle), std::sin(angle)}; }
};

inline Frame frame_of_line(const TestLine& line, double gamma, double row_time_s = 0, double noise = 0) {
  Frame frame{.t = 0, .exposure = kFrameExposure, .size = kFrameSize, .grey = {}};
  std::mt19937 random(1);
  std::normal_distribution<double> normal(0, 1);
  constexpr int kParts = 8, kInstants = 16;
  for (int y = 0; y < kFrameSize.height; ++y)
    for (int x = 0; x < kFrameSize.width; ++x) {
      int ahead = 0;
      const double row_s = (y - 0.5 * (kFrameSize.height - 1)) * row_time_s;
      for (int i = 0; i < kInstants; ++i) {
        const double t_s = row_s + to_seconds(kFrameExposure) * ((i + 0.5) / kInstants - 0.5);
        for (int k = 0; k < kParts * kParts; ++k) {
          const int row = k / kParts, column = k % kParts;
          const Eigen::Vector2d at(x + (column + 0.5) / kParts - 0.5, y + (row + 0.5) / kParts - 0.5);
          ahead += line.normal().dot(at) > line.distance_px + line.speed_px_s * t_s +
                                               0.5 * line.acceleration_px_s2 * t_s * t_s
                       ? 1
                       : 0;
        }
      }
      const double share = static_cast<double>(ahead) / (kInstants * kParts * kParts);
      const double light = line.dark + share * (line.bright - line.dark);
      const double grey = 255 * std::pow(light, 1 / gamma) + noise * normal(random);
      frame.grey.push_back(static_cast<std::uint8_t>(std::lround(std::clamp(grey, 0.0, 255.0))));
    }
  return frame;
}

/// Samples along the line, expected `shift_px` ahead of where it is, at a time `age_s` after the exposure.
inline std::vector<ContourSample> samples_of_line(const TestLine& line, double shift_px, double age_s = 0) {
  std::vector<ContourSample> out;
  const Eigen::Vector2d along(-line.normal().y(), line.normal().x());
  for (double s = -60; s <= 60; s += 4) {
    ContourSample sample;
    sample.pixel = (line.distance_px + shift_px + line.speed_px_s * age_s) * line.normal() + s * along;
    if (!kFrameSize.contains(sample.pixel, 16)) continue;
    sample.normal_px = line.normal();
    sample.speed_px_s = line.speed_px_s;
    sample.jacobian = Vector6d::Zero();
    sample.jacobian[0] = 1;
    out.push_back(sample);
  }
  return out;
}

}  // namespace evpose::test_frames
