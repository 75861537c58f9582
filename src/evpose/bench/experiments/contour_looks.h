// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <tuple>
#include <vector>

#include "evpose/registration/event_registration.h"

namespace evpose::experiments {

/// Distances of events from a contour, with the clutter taken off: its density, linear across the contour, is
/// told by the events too far off to be of the contour. No gate of the tracker enters.
class OffsetSum {
 public:
  static constexpr double kInside_px = 1, kReach_px = 1.5;  ///< a contour's events; all that are counted

  void add(double distance_px);
  OffsetSum& operator+=(const OffsetSum& other);
  /// Events of the contour.
  double events() const;
  /// Of all events inside.
  double share() const;
  /// Sum of their distances, px.
  double sum_px() const;
  /// Of sum_px(), by the number of events alone.
  double variance_px2() const;

 private:
  double inside_ = 0, sum_ = 0, square_ = 0;
  double rim_ = 0, rim_sum_ = 0, rim_square_ = 0;
};

/// What events tell of one contrast segment in a stretch of time, while it moves to one side. Distances are
/// along the motion: negative is late.
struct ContourLook {
  std::uint32_t segment = 0;
  std::int64_t block = 0;  ///< number of the stretch of time
  int motion_side = 1;     ///< +1 if the segment moves to where its normal in the map points
  OffsetSum on, off;       ///< by polarity
  double delay_on_px = 0, delay_off_px = 0;             ///< that the edge delay's law says, mean
  double steps = 0;                                     ///< of contrast, mean; positive: it gets brighter
  double speed_px_s = 0, depth_m = 0;                   ///< mean
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();      ///< mean
  Eigen::Vector2d motion = Eigen::Vector2d::Zero();     ///< across the contour, unit
  Eigen::Vector3d place_map = Eigen::Vector3d::Zero();  ///< mean, m

  double events() const { return on.events() + off.events(); }
  /// Mean distance of the contour's events along the motion.
  double measured_px() const { return (on.sum_px() + off.sum_px()) / events(); }
  /// The same, with the law's delay taken off.
  double left_px() const;
  /// Variance of either by the number of events alone.
  double variance_px2() const { return (on.variance_px2() + off.variance_px2()) / (events() * events()); }
};

/// Gathers looks, one update after the other.
class LookCounter {
 public:
  static constexpr double kBlock_s = 0.05;

  LookCounter(ImageSize size, const ContourMap& map);
  /// `registration` tells contrast and delays.
  void add(const RegistrationProblem& problem, double t_s, const EventRegistration& registration);
  /// Those with enough events to tell of.
  std::vector<ContourLook> looks() const;

 private:
  struct Gathered {
    ContourLook look;  ///< sums where the look has means
    double samples = 0;
  };
  void build_bands(const RegistrationProblem& problem);
  bool stands_alone(std::size_t k, const RegistrationProblem& problem) const;
  Gathered& add_sample(const ContourSample& sample, std::int64_t block,
                       const EventRegistration& registration);

  ImageSize size_;
  const ContourMap& map_;
  AssociationIndex index_;
  std::vector<AssociationBand> bands_;
  std::vector<AssociationIndex::Found> found_;
  std::map<std::tuple<std::uint32_t, std::int64_t, int>, Gathered> gathered_;
  std::vector<Gathered*> of_sample_;  ///< of the last call; null: not counted
};

}  // namespace evpose::experiments
