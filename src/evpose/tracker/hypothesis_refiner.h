// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <deque>
#include <span>
#include <vector>

#include "evpose/map/contour_segments.h"
#include "evpose/map/visible_set.h"
#include "evpose/registration/contour_view.h"
#include "evpose/registration/event_registration.h"
#include "evpose/relocalization/place_cache.h"
#include "evpose/tracker/event_intervals.h"
#include "evpose/tracker/pose_hypothesis.h"

namespace evpose {

/// What the search compares events with, and the settings of the tracker that hold for it too. The references
/// outlive the search.
struct RelocalizerScene {
  const ContourIndex& index;
  const ContourSegments& segments;
  const Camera& camera;
  Eigen::Vector3d gravity_map;           ///< zero when there is no IMU
  VisibleSetConfig visible;              ///< the search has its own number and spacing of points
  EventRegistrationConfig registration;  ///< the search has its own gates and leaves polarity out
  PlaceCache* places = nullptr;          ///< null: searches over metres keep their own
};

/// Refines pose and velocity of a hypothesis together: the single events of the last 40 ms at their own
/// times, seen from where the IMU says that the body was, under gates that close from 3 px to that of the
/// tracker.
class HypothesisRefiner {
 public:
  HypothesisRefiner(const RelocalizerScene& scene, const HypothesisMotion& motion);

  /// Leaves out the events of earlier searches.
  void clear_events() { intervals_.clear(); }
  /// As EventIntervals::add.
  void add_events(std::span<const FilteredEvent> events, std::uint32_t now_us, const ImuIncrement& motion,
                  const Eigen::Vector3d& angular_rate) {
    intervals_.add(events, now_us, motion, angular_rate);
  }

  /// Refines `h` and measures its concentration and support. `slices`: seen since the search began, which
  /// tells how far back its motion is trusted and how well its velocity is known.
  void refine(PoseHypothesis& h, const Pose& T_body_cam, int slices);

 private:
  using Vector9d = Eigen::Matrix<double, 9, 1>;
  using Matrix9d = Eigen::Matrix<double, 9, 9>;

  /// Information about position, rotation and velocity.
  struct NormalEquations {
    Matrix9d H;
    Vector9d b;
  };
  /// Adds the newest `intervals` at the hypothesis' pose, and tells its concentration and support.
  void add_intervals(Registration& registration, const ContourView& view,
                     std::span<const std::uint32_t> points, std::size_t intervals, PoseHypothesis& h,
                     NormalEquations& equations);

  HypothesisMotion motion_;
  const ContourIndex& index_;
  const ContourSegments& segments_;
  const Camera& camera_;
  double map_sigma_m_;
  VisibleSet visible_;
  std::deque<EventRegistration> registrations_;  ///< from a wide gate to the tracker's
  EventIntervals intervals_;
  std::vector<ContourSample> samples_;
};

}  // namespace evpose
