// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <optional>
#include <unordered_map>
#include <vector>

#include "evpose/batch/chain_smoother.h"
#include "evpose/fusion/back_end.h"

namespace evpose {

/// What does not change over the recordings and is estimated with the trajectories: errors of the
/// calibration, offsets of map segments. Each has a place among the parameters of the ChainSmoother, a
/// present value about which everything is linearised, and a prior about what was given, which stays whatever
/// the present value.
class StaticParameters {
 public:
  /// As a resolved FusionConfig asks for them.
  explicit StaticParameters(const FusionConfig& config);

  int size() const { return size_; }
  /// First place of each; none: it is believed.
  struct Places {
    std::optional<int> time, rotation, translation, gravity, intrinsics;
  };
  const Places& places() const { return places_; }
  Eigen::Index intrinsics_count() const { return intrinsics_count_; }
  bool estimates_segments() const { return segments_config_.has_value(); }
  /// Only if it estimates them.
  double segment_length_m() const { return segments_config_->length_m; }
  /// No contour says anything of the rest.
  bool takes_contours() const { return places_.intrinsics.has_value() || estimates_segments(); }
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
  /// What is known without the recordings, about the present values.
  ParameterInformation prior() const;
  /// The calibration's values change by what was found beside them.
  void add(const Calibration& found);
  /// The values change by z.
  void correct(const Eigen::VectorXd& z, const Eigen::MatrixXd& covariance);
  /// Present values minus given ones: calibration only, in the order of the places.
  Eigen::VectorXd calibration_errors() const;

 private:
  std::optional<SegmentOffsetConfig> segments_config_;
  Places places_;
  Eigen::VectorXd calibration_sigma_;  ///< of what was given
  Eigen::Index intrinsics_count_ = 0;
  int calibration_size_ = 0, size_ = 0;
  Calibration found_;
  std::vector<Segment> segments_;
  std::unordered_map<std::uint32_t, std::size_t> segment_of_number_;
};

}  // namespace evpose
