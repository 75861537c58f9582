// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "evpose/camera/frame.h"

namespace evpose {

/// A frame's luminance, 0 at black and 1 at white, and its noise.
class LinearImage {
 public:
  explicit LinearImage(double gamma);

  void set(const Frame& frame);
  /// Bilinear between pixel centres; inside of the image.
  double at(const Eigen::Vector2d& pixel) const;
  bool contains(const Eigen::Vector2d& pixel) const { return size_.contains(pixel, 0.01); }
  /// 1 sigma of one pixel's noise where the luminance is this.
  double noise(double luminance) const;

 private:
  double gamma_;
  std::array<float, 256> luminance_of_;
  ImageSize size_;
  std::vector<float> luminance_;
  double noise_grey_ = 0;  ///< 1 sigma, grey levels
};

}  // namespace evpose
