// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/sensors/frame_camera.h"

#include <gtest/gtest.h>

#include <cmath>

namespace evpose::sim {
namespace {

TEST(SensorNoise, HasTheVarianceOfElectronsAndOfReadingThem) {
  constexpr double kWhite = 50, kFullWell_e = 4000;
  constexpr int kPixels = 20000;
  for (const double luminance : {0.0, 5.0, 50.0}) {
    Random random(1, 2);
    double sum = 0, squares = 0;
    for (int i = 0; i < kPixels; ++i) {
      const double error =
          kFullWell_e / kWhite * (with_sensor_noise(luminance, kWhite, kFullWell_e, random) - luminance);
      sum += error, squares += error * error;
    }
    const double variance_e2 = kFullWell_e * luminance / kWhite + 100;
    EXPECT_NEAR(sum / kPixels, 0, 4 * std::sqrt(variance_e2 / kPixels));
    EXPECT_NEAR(squares / kPixels / variance_e2, 1, 4 * std::sqrt(2.0 / kPixels));
  }
}

TEST(SensorNoise, OfNoElectronsIsNone) {
  Random random(1, 2);
  EXPECT_EQ(with_sensor_noise(3.25, 50, 0, random), 3.25);
}

}  // namespace
}  // namespace evpose::sim
