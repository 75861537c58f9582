// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "evpose/core/error.h"
#include "evpose/core/pose.h"
#include "evpose/imu/imu.h"

namespace evpose {

/// What the magnitudes of a stretch of IMU data say about its units; filled sample by sample.
///
/// Told for sure: an accelerometer whose mean magnitude is near 1 (g) or far below (gravity removed), as
/// specific force averages to gravity over any flight that stays in the air; a gyroscope that turns faster on
/// the whole than any sensor's range, or that disagrees with the turning of a reference trajectory by the
/// factor 180/pi. A slow flight in deg/s without a reference looks like a fast one in rad/s: that cannot be
/// told and is not guessed.
class ImuUnitCheck {
 public:
  void add(const ImuSample& sample);

  std::int64_t count() const { return count_; }
  /// Errors name the key to set: `imu.accel_unit: g`, `imu.gyro_unit: deg/s`. Nothing is said of fewer than
  /// 10 samples.
  Status check_accel(const std::string& where) const;
  Status check_gyro(const std::string& where) const;

 private:
  std::int64_t count_ = 0;
  double accel_sum_ = 0;  ///< of |accel|
  double gyro_square_sum_ = 0;
  std::int64_t beyond_range_ = 0;  ///< samples with a rate beyond a sensor's range
};

/// Both checks of ImuUnitCheck on all samples.
Status check_imu_units(const std::vector<ImuSample>& samples, const std::string& where);

/// Compares the angles that the gyroscope and the reference turned over windows of half a second: finds rates
/// in deg/s at any speed above a crawl. Passes when the two do not overlap or the reference hardly turns.
Status check_gyro_against(const std::vector<TimedPose>& reference, const std::vector<ImuSample>& samples,
                          const std::string& where);

}  // namespace evpose
