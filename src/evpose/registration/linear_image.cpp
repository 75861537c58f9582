// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/linear_image.h"

#include <algorithm>
#include <cmath>

namespace evpose {
namespace {

constexpr double kLeastNoise_grey = 0.3;  // of rounding to whole levels
constexpr std::size_t kEvery = 61;        // pixels; so many are looked at for the noise

/// By the second differences along rows: texture has few of them, noise all.
double noise_of(const Frame& frame) {
  std::vector<double> differences;
  const std::size_t width = static_cast<std::size_t>(frame.size.width);
  for (std::size_t i = 1; i + 1 < frame.grey.size(); i += kEvery) {
    if (i % width == 0 || i % width == width - 1) continue;
    differences.push_back(std::abs(double{0} + frame.grey[i - 1] - 2.0 * frame.grey[i] + frame.grey[i + 1]));
  }
  if (differences.empty()) return kLeastNoise_grey;
  const auto middle = differences.begin() + static_cast<std::ptrdiff_t>(differences.size() / 2);
  std::nth_element(differences.begin(), middle, differences.end());
  constexpr double kSigmaOfMedian = 1.4826, kOfSecondDifference = 2.449;  // sqrt(1 + 4 + 1)
  return std::max(kLeastNoise_grey, kSigmaOfMedian * *middle / kOfSecondDifference);
}

}  // namespace

LinearImage::LinearImage(double gamma) : gamma_(gamma) {
  for (std::size_t g = 0; g < luminance_of_.size(); ++g)
    luminance_of_[g] = static_cast<float>(std::pow(static_cast<double>(g) / 255, gamma));
}

void LinearImage::set(const Frame& frame) {
  size_ = frame.size;
  luminance_.resize(frame.grey.size());
  std::transform(frame.grey.begin(), frame.grey.end(), luminance_.begin(),
                 [this](std::uint8_t g) { return luminance_of_[g]; });
  noise_grey_ = noise_of(frame);
}

double LinearImage::at(const Eigen::Vector2d& pixel) const {
  const auto x = static_cast<std::size_t>(pixel.x()), y = static_cast<std::size_t>(pixel.y());
  const double u = pixel.x() - static_cast<double>(x), v = pixel.y() - static_cast<double>(y);
  const float* p = &luminance_[y * static_cast<std::size_t>(size_.width) + x];
  const float* q = p + size_.width;
  return (1 - v) * ((1 - u) * p[0] + u * p[1]) + v * ((1 - u) * q[0] + u * q[1]);
}

double LinearImage::noise(double luminance) const {
  // Derivative of luminance by grey level; at black that of the first level.
  const double grey = std::max(1.0 / 255, std::pow(std::max(luminance, 0.0), 1 / gamma_));
  return noise_grey_ * gamma_ * std::pow(grey, gamma_ - 1) / 255;
}

}  // namespace evpose
