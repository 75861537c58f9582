// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evpose/core/pose.h"
#include "evpose/tracker/pose_verifier.h"

namespace evpose {

/// What the looks at the contours say of a pose over time: whether it is verified, contradicted, or contested
/// by the contours of one direction, and how far off it may be then.
class VerdictHistory {
 public:
  /// `map_may_be_wrong`: the map states errors of its contours.
  explicit VerdictHistory(bool map_may_be_wrong) : map_may_be_wrong_(map_may_be_wrong) {}

  struct Look {
    PoseVerdict verdict = PoseVerdict::open;
    double span_s = 0;      ///< since the last one
    bool watched = false;   ///< the pose was chosen among many because it agrees, lately
    bool measured = false;  ///< the events have told where it is
    bool probable = false;  ///< it is the right one; see PoseProbability
  };
  void add(const Look& look);
  /// The pose is another one from now on, chosen among many; `start_was_wrong`: near one that was given and
  /// refuted, so that the right one may not have been among them.
  void found(bool start_was_wrong);
  /// The pose is right, by other means than events.
  void verify() { verified_ = true; }
  /// The pose is wrong, and is being searched.
  void contradict();

  /// The events have confirmed the pose since it was given or found.
  bool verified() const { return verified_; }
  bool is_contradicted() const;
  bool is_hopeless() const;
  bool is_contested() const;

  /// How far off the pose may be, beyond what its covariance tells: variances of position and rotation, as
  /// Pose::plus. `watched` as of a look.
  Matrix6d doubt(bool watched) const;

  /// 1 sigma of a pose that was chosen among many: others explain the events nearly as well.
  static constexpr double kFoundPosition_m = 0.03, kFoundRotation_rad = 0.01;

 private:
  double needed_s(bool watched) const;

  bool map_may_be_wrong_;
  bool verified_ = false;
  bool start_was_wrong_ = false;  ///< refuted before it was verified: this pose, or that which it was near
  double contradicted_s_ = 0;     ///< for how long the events have contradicted the pose
  double contested_s_ = 0;        ///< for how long in a row one direction's contours have had none
  double confirmed_s_ = 0;        ///< for how long in a row they have confirmed it
  double found_doubt_ = 0;        ///< of a pose that was found, from 1 on; 0: it was given
};

}  // namespace evpose
