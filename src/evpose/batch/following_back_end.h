// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <span>
#include <utility>
#include <vector>

#include "evpose/batch/chain_smoother.h"
#include "evpose/batch/static_parameters.h"
#include "evpose/fusion/back_end.h"
#include "evpose/fusion/joint_measurement.h"

namespace evpose {

/// Told of the contours that a state of the trajectory was measured with.
using ContourCallback = std::function<void(const FusionState&, std::span<const ContourOffset>)>;

/// In place of a fusion: the tracker measures along a known trajectory, and what IMU and contours say about
/// its errors goes to a smoother (one step of Gauss-Newton over the whole recording).
class FollowingBackEnd final : public BackEnd {
 public:
  /// `trajectory`: the states at the start and at each update, with their covariance; `T_body_cam` and the
  /// propagator's gravity: at the parameters' present values. References are kept.
  FollowingBackEnd(const StatePropagator& propagator, std::span<const FusionState> trajectory,
                   const Pose& T_body_cam, StaticParameters& parameters, ChainSmoother& chain);

  void on_contours(ContourCallback callback) { contour_callback_ = std::move(callback); }

  using BackEnd::start;
  using BackEnd::update;
  /// First: what is known of the state at the start. Later, when the tracker takes biases up again that it
  /// had given up, those before do not bind those after.
  void start(const FusionState& first) override;
  void predict(const ImuSample& a, const ImuSample& b, ImuTrust trust) override;
  void predict(TimeNs t) override;
  void update(const PoseInformation& measurement, std::span<const ContourOffset> contours) override;
  bool takes_contours() const override { return parameters_.takes_contours(); }
  Eigen::Vector3d displacement_of(std::uint32_t segment) const override;
  const FusionState& state() const override { return state_; }
  /// Zero: the trajectory needs no alignment of its start.
  Eigen::MatrixXd seen_covariance() const override;
  Calibration calibration() const override;

 private:
  void add_step(const Matrix15d& transition, double dt_s);
  void add_axes(const Eigen::Vector3d& rate, const Eigen::Vector3d& force, const Matrix15d& transition);
  void arrive();
  void add_contours(std::span<const ContourOffset> contours);
  Eigen::Vector3d rate_over(std::size_t k, TimeNs to_each_side, double* dt_s) const;
  double quick_share() const;
  Vector6d seen_pose_by_time() const;
  ChainMeasurement by_parameters() const;

  std::span<const FusionState> trajectory_;
  Pose T_body_cam_;
  StaticParameters& parameters_;
  ChainSmoother& chain_;
  std::size_t next_ = 0;  ///< in the trajectory
  FusionState state_;     ///< of the trajectory, or between two of its states as the IMU has it
  // Since the last state of the trajectory.
  FusionState predicted_;  ///< its covariance is what the IMU's noise has added
  Matrix15d transition_ = Matrix15d::Identity();
  Eigen::Matrix<double, 15, 2> by_tilt_ = Eigen::Matrix<double, 15, 2>::Zero();
  Eigen::Matrix<double, 15, 18> by_axes_ = Eigen::Matrix<double, 15, 18>::Zero();
  JointMeasurement measurement_;
  ContourCallback contour_callback_;
  double quick_share_ = 0;
  std::vector<int> places_;  ///< first parameter of each block of the measurement, by its id
};

}  // namespace evpose
