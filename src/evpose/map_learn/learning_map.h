// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "evpose/map/contour_map.h"
#include "evpose/map/contour_segments.h"
#include "evpose/map_learn/joint_adjustment.h"
#include "evpose/map_learn/observe_flight.h"

namespace evpose::map_learn {

/// What became of the contours, m.
struct LearntLengths {
  double kept_m = 0;    ///< of the given map, not seen well enough to say anything
  double moved_m = 0;   ///< of the given map, told anew by events
  double struck_m = 0;  ///< of the given map, contradicted by events
  double gone_m = 0;    ///< of the given map, had told its contrast before and was seen without events
  double silent_m = 0;  ///< of kept_m: seen without events, but never known to tell any
  double new_m = 0;     ///< markings and depth edges that were learnt
};

/// A map whose contours move, go and come while flights are adjusted to it.
class LearningMap {
 public:
  explicit LearningMap(const ContourMap& given);

  /// As it is now.
  const ContourMap& map() const { return map_; }
  /// Moves the given contours to where they are already known to stand off: of each point, map frame, m.
  void displace(const std::vector<Eigen::Vector3d>& displacements);
  /// Markings, or edges on no plane, whose place is as well known as the trajectory that they were seen from.
  void add_new(const std::vector<ContourPoint>& points);

  /// The contrast segments of map() as unknowns, with what was known of each before this flight. What
  /// earlier flights have told shares the error of their frame: unknowns 0 to 5 (LearntFrame).
  std::vector<Landmark> landmarks(const ContourSegments& segments) const;
  /// That error as known by now, and the covariance that it had before this flight; empty without one.
  const Eigen::VectorXd& shared() const { return shared_; }
  Eigen::MatrixXd shared_covariance() const;
  /// What all that has been told has in common from this flight on.
  void set_frame(const Eigen::Vector3d& about, const Matrix6d& covariance) {
    map_.learnt = {about, covariance};
  }
  /// Moves contours; strikes those out that the events contradict, or that had
  /// events before and have none now, and markings that are not sure.
  /// `observed`: of map() as it is now, in the order of the result's landmarks.
  void apply(const AdjustmentResult& result, const ContourSegments& segments,
             const FlightObservations& observed);

  LearntLengths lengths() const;
  std::int32_t next_contour() const;

 private:
  /// Beside a point of map_.
  struct Record {
    Eigen::Vector3f given = Eigen::Vector3f::Zero();  ///< where it was before this flight
    float given_sigma = 0;
    bool is_new = false;       ///< found by this flight
    bool was_told = false;     ///< by events of this flight
    bool told_before = false;  ///< its contrast is known from before this flight
    bool silent = false;       ///< as last seen
    std::uint16_t looks = 0;   ///< before this flight
    Eigen::Vector3f seen_from = Eigen::Vector3f::Zero();
  };
  /// Displacement of a place by the error of the frame, map frame.
  Eigen::Matrix<double, 3, 6> by_frame(const Eigen::Vector3d& at) const;
  Landmark told_before(const Landmark& l, const Eigen::Vector3d& at, double stated_m) const;
  void take(const LandmarkEstimate& e, const Landmark& l, const Eigen::Vector3d& from, std::size_t point);

  ContourMap map_;
  std::vector<Record> records_;
  std::optional<LearntFrame> frame_;  ///< of what earlier flights have told
  Eigen::VectorXd shared_;
  double struck_m_ = 0, gone_m_ = 0;
};

}  // namespace evpose::map_learn
