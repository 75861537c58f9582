// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include "evpose/fusion/back_end.h"
#include "evpose/fusion/calibration_states.h"
#include "evpose/fusion/segment_offsets.h"

namespace evpose {

/// Error-state Kalman filter on T_map_body, velocity and IMU biases: the fusion of prediction (EV-Pose eq. 2,
/// 4) and pose measurement (eq. 3, 5) for one newest state. If asked, the calibration and offsets of map
/// segments are further states, in any combination.
class Ekf : public BackEnd {
 public:
  explicit Ekf(const StatePropagator& propagator, const FusionConfig& config = {},
               const Pose& T_body_cam = {});

  using BackEnd::start;
  using BackEnd::update;
  /// Forgets the offsets of segments: they were told by the pose that is given up.
  void start(const FusionState& first) override;
  void predict(const ImuSample& a, const ImuSample& b, ImuTrust trust) override;
  void predict(TimeNs t) override;
  void update(const PoseInformation& measurement, std::span<const ContourOffset> contours) override;
  void update(const SeenMeasurement& measurement) override;
  Eigen::MatrixXd seen_covariance() const override;
  bool takes_contours() const override { return true; }
  Eigen::Vector3d displacement_of(std::uint32_t segment) const override;
  const FusionState& state() const override { return filter_.state(); }
  FusionState reported_state() const override;
  Matrix6d measured_covariance() const override;
  Calibration calibration() const override { return calibration_.calibration(); }

  void keep_pose() override;
  std::optional<Pose> kept_pose() const override { return kept_pose_; }
  void update(const RelativeInformation& measurement) override;

  const ErrorStateFilter& filter() const { return filter_; }
  /// None if their offsets are no states.
  std::span<const SegmentOffsets::Segment> segments() const;

 private:
  bool blocks_take_contours() const { return offsets_.has_value() || calibration_.takes_contours(); }
  void add_contours(std::span<const ContourOffset> contours);
  void apply_corrections();
  void forget_kept_pose();

  ErrorStateFilter filter_;
  CalibrationStates calibration_;
  std::optional<SegmentOffsets> offsets_;
  BlockId kept_{};  ///< of kept_pose_
  std::optional<Pose> kept_pose_;
  JointMeasurement measurement_;  ///< of the last update
  Matrix6d share_of_blocks_ = Matrix6d::Zero();
};

}  // namespace evpose
