// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "evpose/imu/strapdown.h"
#include "evpose/map/visible_set.h"
#include "evpose/registration/pose_search.h"
#include "evpose/tracker/contour_view.h"

namespace evpose {

struct RelocalizationConfig {
  bool on = true;
  double from_px = 2.5;  ///< a start pose known better than this, as image motion, needs no search
  double slice_events_per_column =
      30;                        ///< a slice of events is complete with so many times the image's width
  double short_slice_s = 0.015;  ///< ... or with a quarter of them after this
  double longest_slice_s = 0.03;
  double gap_s = 0.004;               ///< between slices
  int least_slices = 4;               ///< before a pose is believed
  int most_slices = 10;               ///< then the search starts anew, further around
  int sharpened = 8;                  ///< poses whose events are looked at one by one
  double least_concentration = 0.42;  ///< of a pose that is believed, how its events gather at the contours
  double least_lead = 1.15;           ///< ... and its lead over the next, in events that gather
  double low_concentration = 0.3, clear_lead = 2;  ///< less will do for a pose without a rival
  double velocity_sigma_m_s = 2;                   ///< of the vehicle when the search begins
  double position_sigma_m = 0.1;                   ///< around the last known pose when it was lost, per axis
  double rotation_sigma_rad = 0.035;
  double verify_s = 0.06;   ///< a pose found is watched for so long before it is called tracking
  double patience_s = 0.5;  ///< lost, or events that do not gather at the contours, for so long: search
  double found_position_sigma_m = 3e-3, found_rotation_sigma_rad = 2e-3, found_velocity_sigma_m_s = 0.3;
  PoseSearchConfig search;
};
void describe(ConfigTable& table, RelocalizationConfig& config);

/// Finds the pose from a poor guess. In a first slice of events many poses are compared (PoseSearch); the
/// best are followed over the next slices. In each a pose is sharpened together with its velocity: single
/// events of the last 40 ms at their own times, seen from where the IMU says that the body was, under gates
/// that close from 3 px to that of the tracker. How many events gather at the contours then, rather than lie
/// evenly over the gate, tells the true pose.
class Relocalizer {
 public:
  /// `gravity_map`: zero when there is no IMU.
  Relocalizer(const RelocalizationConfig& config, const ContourIndex& index, const ContourSegments& pieces,
              const Camera& camera, const Pose& T_body_cam, const Eigen::Vector3d& gravity_map);

  /// Begins a search around `state`; covariance of its pose as Pose::plus.
  void begin_search(TimeNs t, const NavState& state, const Matrix6d& covariance);
  bool searching() const { return searching_; }
  /// The pose found was wrong: goes on around where the search began.
  void restart_search(TimeNs t);
  /// How the body has moved since the last call of this or process(), while a pose found is looked at.
  void add_motion(const ImuIncrement& motion) { since_ = joined(since_, motion); }

  struct Found {
    NavState nav;
    Eigen::Vector3d angular_rate;  ///< rad/s, body
  };
  /// One update: the events since the last one and how the body has moved since. The pose at t once it is
  /// found.
  std::optional<Found> process(TimeNs t, std::uint32_t now_us, std::span<const FrontEvent> events,
                               const ImuIncrement& motion, const Eigen::Vector3d& angular_rate);

 private:
  struct Hypothesis {
    NavState nav;
    Eigen::Vector3d rate = Eigen::Vector3d::Zero();  ///< without a gyroscope
    double position_variance = 0, velocity_variance = 0, covariance = 0, rotation_variance = 0;
    double concentration = 0, mean_concentration = 0;  ///< of its events when sharpened; mean over slices
    double support = 0,
           mean_support = 0;  ///< events of a point that gather there beyond an even spread; mean
  };
  /// Some events one after another, up to now_us, and how the body moved meanwhile.
  struct Interval {
    std::vector<FrontEvent> events;
    std::uint32_t now_us = 0;
    ImuIncrement motion;
    Eigen::Vector3d rate = Eigen::Vector3d::Zero();
  };
  void propagate(Hypothesis& c, const ImuIncrement& motion) const;
  void search_around_prior(double age_s);
  void update_hypotheses(double age_s);
  void correct_by_displacement(Hypothesis& c, const Vector6d& moved) const;
  void merge_duplicates();
  void select_search_points(const Pose& T_map_body);
  void compensate_rotation(double age_s, std::uint32_t now_us);
  void append_interval(std::uint32_t now_us, std::span<const FrontEvent> events, const ImuIncrement& motion);
  NavState propagate_back(const Hypothesis& c, const NavState& nav, const ImuIncrement& motion) const;
  void refine(Hypothesis& c);
  std::optional<Found> accept_best();
  double pause_s() const;

  RelocalizationConfig config_;
  const ContourIndex& index_;
  const ContourSegments& pieces_;
  const Camera& camera_;
  Pose T_body_cam_;
  Eigen::Vector3d gravity_map_;
  bool has_imu_;
  PoseSearch search_;

  bool searching_ = false;
  NavState prior_;  ///< at the last slice
  Matrix6d prior_covariance_ = Matrix6d::Zero();
  std::vector<Hypothesis> hypotheses_;
  std::vector<FrontEvent> slice_, compensated_;
  std::deque<Interval> intervals_;  ///< the newest last
  TimeNs slice_begin_ = 0, last_slice_ = 0;
  ImuIncrement since_;    ///< motion since the last slice, or since begin_search()
  double elapsed_s_ = 0;  ///< from begin_search() to the last slice
  Eigen::Vector3d rate_ = Eigen::Vector3d::Zero();
  int slices_ = 0, searches_ = 0;
  std::unique_ptr<EdgeField> field_;
  std::unique_ptr<VisibleSet> visible_, all_visible_;
  std::vector<std::unique_ptr<EventAlignment>> stages_;  ///< from a wide gate to the tracker's
  std::vector<ContourSample> samples_;
  std::vector<SearchPoint> points_;
};

}  // namespace evpose
