// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <optional>
#include <unordered_map>
#include <vector>

#include "evpose/batch/chain_smoother.h"
#include "evpose/fusion/back_end.h"
#include "evpose/fusion/shared_errors.h"
#include "evpose/imu/imu.h"

namespace evpose {

/// What is found of the parameters, and how sure it is; by their places.
struct ParameterSolution {
  Eigen::VectorXd z;
  Eigen::MatrixXd covariance;
};

/// What does not change over the recordings and is estimated with the trajectories: errors of the
/// calibration, offsets of map segments and, where it is asked for, of the IMU's axes, and errors that all
/// contours share (SharedErrors). Each has a place among the parameters of the ChainSmoother, a present value
/// about which everything is linearised, and a prior about what was given, which stays whatever the present
/// value. What is measured does not depend on the value of the shared errors, so theirs stays zero and each
/// pass finds them anew.
class StaticParameters {
 public:
  /// What to make of errors that all contours share.
  enum class Shared { left_out, estimated };
  /// As a resolved FusionConfig asks for them.
  explicit StaticParameters(const FusionConfig& config, Shared shared = Shared::left_out);
  /// `imu`: with the sigmas of its axes, which become parameters; those that are not stated are the config's.
  StaticParameters(const FusionConfig& config, Shared shared, const ImuAxes& imu);

  int size() const { return size_; }
  /// First place of each; none: it is believed.
  struct Places {
    std::optional<int> time, rotation, translation, gravity, intrinsics;
    /// 18: elements (row by row) of the gyroscope's, then the accelerometer's E, where the axes are the given
    /// ones times I + E.
    std::optional<int> imu_axes;
    int shared = 0;  ///< after the calibration
  };
  const Places& places() const { return places_; }
  Eigen::Index intrinsics_count() const { return intrinsics_count_; }
  bool estimates_segments() const { return segments_config_.has_value(); }
  /// Its place. None: they are left out; or a delay of all events, where the time offset is estimated.
  std::optional<int> shared_error(int number) const {
    if (shared_ == Shared::left_out || (number == 0 && places_.time)) return {};
    return places_.shared + number;
  }
  /// Only if it estimates them.
  double segment_length_m() const { return segments_config_->length_m; }
  /// No contour says anything of the rest.
  bool takes_contours() const {
    return places_.intrinsics || estimates_segments() || shared_ == Shared::estimated;
  }
  /// The calibration's parameters come first.
  int calibration_size() const { return calibration_size_; }

  struct Segment {
    int place = 0;
    Eigen::Vector3d across_map;  ///< unit: the offset's direction, in which the segment was first seen
    double offset_m = 0, sigma_m = 0;
  };
  /// The segment becomes a parameter when it is seen first.
  const Segment& segment(const ContourOffset& contour, const Eigen::Vector3d& across_map);
  /// From where the map has the segment, map frame, m; zero before it is seen.
  Eigen::Vector3d displacement_of(std::uint32_t segment) const;

  /// The present values, as differences from what was given, with their sigmas.
  const Calibration& calibration() const { return found_; }
  /// The given axes of the IMU with what was found of them, and their sigmas.
  ImuAxes corrected(const ImuAxes& given) const;
  /// What is known without the recordings, about the present values.
  ParameterInformation prior() const;
  /// The parameters by the prior and by what recordings say of them, about the present values. `trust`:
  /// factor on the information of what was given of the calibration.
  ParameterSolution solve(const ParameterInformation& of_recordings, double trust = 1) const;
  /// The largest change of a number of the calibration, in sigma.
  double change(const ParameterSolution& solution) const;
  /// The calibration's values change by what was found beside them.
  void add(const Calibration& found);
  /// The values change by the solution.
  void correct(const ParameterSolution& solution);
  /// Present values minus given ones: of the calibration and the IMU's axes, in the order of the places.
  Eigen::VectorXd calibration_errors() const;
  /// Of what was given, in the order of the places.
  const Eigen::VectorXd& given_sigma() const { return given_sigma_; }
  /// Of the last correction, as CalibrationSigma::correlation: n intrinsics, and with an IMU its pose and
  /// time.
  Eigen::MatrixXd calibration_correlation(Eigen::Index n, bool with_imu) const;

 private:
  StaticParameters(const FusionConfig& config, Shared shared, const Eigen::VectorXd& imu_axes_sigma);
  void state_prior(const CalibrationConfig& config, const std::vector<double>& sigmas);

  Shared shared_;
  std::optional<SegmentOffsetConfig> segments_config_;
  Places places_;
  Eigen::VectorXd given_sigma_;              ///< of the calibration
  Eigen::MatrixXd calibration_information_;  ///< about what was given
  Eigen::Index intrinsics_count_ = 0;
  int calibration_size_ = 0, size_ = 0;
  Calibration found_;
  Eigen::VectorXd imu_axes_, imu_axes_sigma_;  ///< E; empty: believed
  Eigen::MatrixXd calibration_covariance_;
  std::vector<Segment> segments_;
  std::unordered_map<std::uint32_t, std::size_t> segment_of_number_;
};

}  // namespace evpose
