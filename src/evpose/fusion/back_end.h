// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>

#include "evpose/camera/adjusted_camera.h"
#include "evpose/fusion/fusion_config.h"
#include "evpose/fusion/state.h"
#include "evpose/fusion/state_propagator.h"
#include "evpose/imu/imu.h"

namespace evpose {

/// What is found to be wrong with what was given.
struct Calibration {
  double time_offset_s = 0;  ///< IMU time of an instant minus camera time, beside the configured one
  Eigen::Quaterniond turn = Eigen::Quaterniond::Identity();  ///< true R_body_cam = turn * given
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();           ///< true p_body_cam = given + shift, m
  Eigen::Vector2d gravity_tilt_rad =
      Eigen::Vector2d::Zero();  ///< true gravity turned about the map's x and y
  /// Of the camera: true numbers minus given ones, as AdjustedCamera orders them; empty: not asked for.
  Eigen::VectorXd intrinsics, intrinsics_sigma;
  double time_sigma_s = 0;
  Eigen::Vector3d shift_sigma_m = Eigen::Vector3d::Zero();
  Eigen::Vector2d gravity_sigma_rad = Eigen::Vector2d::Zero();
  Eigen::Vector3d turn_sigma_rad = Eigen::Vector3d::Zero();  ///< about the body's axes
  bool frozen = true;  ///< too little motion to tell it from an error of the pose
};

/// The pose that is seen, the velocity and the camera's numbers, measured together: near the present values
/// their cost is d^T information d / 2 - vector^T d, with d = (pose as Pose::plus, velocity, numbers).
struct SeenMeasurement {
  static constexpr int kVelocity = 6, kNumbers = 9;
  Eigen::MatrixXd information;
  Eigen::VectorXd vector;
};

/// What is measured of the pose and a kept one together, and what that says of the camera: near the present
/// values its cost is d^T information d / 2 - vector^T d, with d = (pose, kept pose, each as Pose::plus;
/// Calibration::turn; camera's numbers, where they are states).
struct RelativeInformation {
  static constexpr int kPoses = 12, kNumbers = 15;  ///< where turn and numbers begin
  static constexpr int kMost = kNumbers + AdjustedCamera::kMostNumbers;
  using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, kMost, 1>;
  using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, kMost, kMost>;
  explicit RelativeInformation(int numbers = 0)
      : information(Matrix::Zero(kNumbers + numbers, kNumbers + numbers)),
        vector(Vector::Zero(kNumbers + numbers)) {}

  Matrix information;
  Vector vector;
};

/// What the tracker asks of a fusion framework. Time goes forward: start, then predict and update in turn.
class BackEnd {
 public:
  explicit BackEnd(const StatePropagator& propagator) : propagator_(propagator) {}
  virtual ~BackEnd() = default;

  /// Begins, or begins anew; what was found of the calibration is kept.
  virtual void start(const FusionState& first) = 0;
  /// With the configured uncertainty. `angular_rate_body` is used by constant velocity only.
  void start(TimeNs t, const NavState& nav, const Eigen::Vector3d& angular_rate_body) {
    start(propagator_.initial_state(t, nav, angular_rate_body));
  }
  /// IMU model: one step between two samples; a.t must be the state's time. Both in the body frame.
  virtual void predict(const ImuSample& a, const ImuSample& b, ImuTrust trust) = 0;
  /// Constant velocity: to time t >= the state's.
  virtual void predict(TimeNs t) = 0;
  /// Measurement at the state's time, relative to state().nav.T_map_body, as registration returns it; its
  /// contours one by one for a back end that takes them.
  virtual void update(const PoseInformation& measurement, std::span<const ContourOffset> contours) = 0;
  void update(const PoseInformation& measurement) { update(measurement, {}); }
  virtual bool takes_contours() const { return false; }
  /// Where a segment of the map is known to stand, from where the map has it; map frame, m. Contours are to
  /// be measured there.
  virtual Eigen::Vector3d displacement_of(std::uint32_t /*segment*/) const { return Eigen::Vector3d::Zero(); }
  /// The newest state, with its covariance. A copy can be carried to any later time by propagator().
  virtual const FusionState& state() const = 0;
  /// The same with the covariance that is reported: with what the framework knows to be uncertain beside what
  /// it weighs measurements by.
  virtual FusionState reported_state() const { return state(); }

  /// Of the pose that the next measurement will see: the state's, and what further states add.
  virtual Matrix6d measured_covariance() const { return state().pose_covariance(); }
  /// The same with the velocity (3) and the camera's numbers, as far as these are states.
  virtual Eigen::MatrixXd seen_covariance() const;
  /// Takes what it tells of the pose; more where a framework can.
  virtual void update(const SeenMeasurement& measurement);
  virtual Calibration calibration() const { return {}; }

  /// From now on the state's pose is kept as a further state, in place of one that was kept before. Nothing
  /// where a framework cannot.
  virtual void keep_pose() {}
  /// T_map_body of that time, as it is known now; none: no pose is kept.
  virtual std::optional<Pose> kept_pose() const { return std::nullopt; }
  /// Measurement of the pose and the kept one, relative to their present values, and of the camera where that
  /// is estimated.
  virtual void update(const RelativeInformation& /*measurement*/) {}

  const StatePropagator& propagator() const { return propagator_; }

 protected:
  void set_gravity_map(const Eigen::Vector3d& gravity) { propagator_.set_gravity_map(gravity); }

 private:
  StatePropagator propagator_;
};

/// `config` as resolved() returns it; `T_body_cam` as given, used by the calibration alone.
std::unique_ptr<BackEnd> make_back_end(MotionModel model, const FusionConfig& config, const ImuNoise& noise,
                                       const Pose& T_body_cam);

}  // namespace evpose
