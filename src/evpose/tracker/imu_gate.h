// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <deque>
#include <span>
#include <string>

#include "evpose/fusion/back_end.h"
#include "evpose/imu/strapdown.h"
#include "evpose/tracker/imu_agreement.h"
#include "evpose/tracker/imu_watch.h"

namespace evpose {

/// Everything between the IMU's samples and the prediction: which of them are used, how far each is trusted,
/// and what stands in where the IMU is silent or contradicts the camera. Without an IMU it predicts by
/// constant velocity.
class ImuGate {
 public:
  /// An IMU that is silent for longer is not waited for.
  static constexpr TimeNs kPatience = 50 * kNsPerMs;

  ImuGate(const ImuWatchConfig& config, MotionModel model) : model_(model), watch_(config) {}

  /// Checks a sample. The samples that may be used now, in order of time; valid until the next call.
  std::span<const CheckedImu> add(const ImuSample& sample, TimeNs state_t);
  /// Whether a prediction up to t needs no sample that is still to come.
  bool reaches(TimeNs t) const;

  /// Carries the fusion to time t over the samples, or by what stands in for them (EV-Pose eq. 2, 4). How the
  /// body has moved since the fusion's last time, by the IMU alone.
  ImuIncrement predict(BackEnd& fusion, TimeNs t);
  /// Holds the IMU against the estimate after an update.
  void compare(const BackEnd& fusion);
  /// The estimate comes from elsewhere: comparisons with what it was do not count.
  void restart_comparison() { agreement_.restart(); }

  /// How far a step between two samples is trusted at time t.
  ImuTrust trust(const CheckedImu& a, const CheckedImu& b, TimeNs t) const;
  /// The IMU was found to contradict the camera, and is not relied on at t.
  bool contradicts(TimeNs t) const { return agreement_.distrusted(t); }
  /// The last prediction had no samples to go by.
  bool silent() const { return silent_; }
  /// What is wrong with the samples at t, in words; empty if nothing is.
  std::string fault(TimeNs t) const { return silent_ ? "no IMU samples" : watch_.fault(t); }
  /// Reading at the fusion's time, which the last prediction has reached.
  const ImuSample& reading() const { return samples_.front().sample; }
  /// A reading of a body that keeps its velocity and its rate, in place of one that is wrong.
  ImuSample held_reading(TimeNs t, const FusionState& state, const Eigen::Vector3d& gravity_map) const;

 private:
  bool hold_over_silence(TimeNs t, const BackEnd& fusion);
  void enter_or_leave_blindness(BackEnd& fusion, TimeNs t);
  FusionState with_imu_biases(const FusionState& state) const;
  void begin_samples_at(TimeNs t);
  void step(BackEnd& fusion, const CheckedImu& a, const CheckedImu& b, TimeNs t, ImuIncrement* moved);

  MotionModel model_;
  ImuWatch watch_;
  ImuAgreement agreement_;
  std::deque<CheckedImu> samples_;  ///< from the fusion's time on; the first stands at it once predicted
  bool silent_ = false;
  // While the IMU is silent or not relied on (blind), the gyroscope's bias stands for the rate that a held
  // reading does not know; afterwards both biases are what they were.
  bool blind_ = false;
  FusionState before_blind_;
  Eigen::Vector3d held_gyro_ = Eigen::Vector3d::Zero();  ///< reading of the last rate that was trusted, rad/s
};

}  // namespace evpose
