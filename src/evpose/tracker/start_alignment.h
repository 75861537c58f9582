// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "evpose/camera/adjusted_camera.h"
#include "evpose/fusion/back_end.h"
#include "evpose/registration/event_registration.h"
#include "evpose/tracker/event_intervals.h"
#include "evpose/tracker/hypothesis_refiner.h"

namespace evpose {

/// What is known of the camera's view before it has told anything.
struct SeenPrior {
  NavState nav;                        ///< pose as it is seen: the body's, were the given T_body_cam true
  AdjustedCamera::Correction numbers;  ///< of the camera, present correction; empty: they are known
  Eigen::MatrixXd covariance;          ///< of pose (as Pose::plus), velocity, numbers
};

/// Aligns the first view of a camera whose calibration is uncertain, or whose start is poorly known in pose
/// and velocity. Contours then lie up to several pixels from where they are expected, further than the
/// tracker's gate reaches, and not all by the same motion: an error of the focal length moves the rim alone.
/// So it is first looked up how many events lie at each distance across each contour (ContourProfiles), and
/// which errors of the prior would put the contours at most events. From several of these the events of the
/// first moments are looked at again and again, at their own times and under gates that close from two pixels
/// to the tracker's (graduated non-convexity), for the pose, the velocity and the camera's numbers together.
/// What gathers most events at the contours is taken, if most starting points lead there, or the events are
/// many and some do, or no other view has nearly as many, or the events that follow confirm it. Errors that
/// the events of one edge share, the map's among them, are eliminated with a variance of their own for each
/// edge (Student-t), so that the covariance is one that single disturbed edges do not mislead.
class StartAlignment {
 public:
  /// Worth its time where contours are expected to lie further off than this, px (root mean square).
  static constexpr double kNeededAbove_px = 1;

  /// `camera`: if its numbers are estimated, the scene's camera; else null. References are kept.
  StartAlignment(const RelocalizerScene& scene, AdjustedCamera* camera);

  /// How far these contours may lie off, root mean square, px.
  double expected_offset_px(const SeenPrior& prior, std::span<const ContourSample> samples,
                            const Pose& T_body_cam) const;

  /// As EventIntervals::add.
  void add_events(std::span<const FilteredEvent> events, std::uint32_t now_us, const ImuIncrement& motion,
                  const Eigen::Vector3d& angular_rate) {
    intervals_.add(events, now_us, motion, angular_rate);
  }
  bool has_enough() const { return intervals_.duration_s() >= kDuration_s; }
  /// What the events added so far say of pose, velocity and numbers about the prior's mean. None: no view was
  /// found at which they gather at the contours; other events are then waited for. Changes the camera's
  /// correction.
  std::optional<SeenMeasurement> align(const SeenPrior& prior, const Pose& T_body_cam);

 private:
  static constexpr double kDuration_s = 0.04;

  struct Begin {
    Pose T_map_body;
    AdjustedCamera::Correction numbers;
  };
  /// One begin of the iteration, and where it led.
  struct Trial {
    Trial(const SeenPrior& prior, const Begin& begin);
    NavState nav;
    AdjustedCamera::Correction numbers;
    Eigen::MatrixXd H;      ///< information about (pose, velocity, numbers) at the end
    Eigen::VectorXd b;      ///< its vector
    Eigen::VectorXd moved;  ///< from the prior's mean
    double concentration = 0, support = 0;
    std::map<std::uint32_t, double> edge_variances;  ///< px^2, by edge
  };
  /// Sums of one edge over samples and intervals.
  struct EdgeSum {
    Eigen::VectorXd row;
    double weight = 0, offset = 0, map_variance = 0;  ///< the last one times weight
  };
  std::vector<Begin> begins(const SeenPrior& prior, const Pose& T_body_cam);
  Eigen::MatrixXd displacement_rows(const SeenPrior& prior, const Pose& T_body_cam,
                                    std::span<const std::uint32_t> slots, std::size_t count) const;
  Trial anneal(const SeenPrior& prior, const Begin& begin, const Pose& T_body_cam);
  std::vector<std::uint32_t> visible_from(const Pose& T_map_cam, const VisibleSetConfig& config) const;
  bool confirms_last(const SeenPrior& prior, const Trial& view);
  bool is_right(const Trial& view, double agreeing, bool alone) const;
  void look(const SeenPrior& prior, const Pose& T_body_cam, std::span<const std::uint32_t> points,
            EventRegistration& registration, Trial& trial);
  void add_offsets(const EventRegistration& registration, const Pose& T_cam_map,
                   const Eigen::Matrix<double, 6, 9>& by_state, std::map<std::uint32_t, EdgeSum>& edges,
                   Trial& trial) const;
  void add_edges(const std::map<std::uint32_t, EdgeSum>& edges, Trial& trial) const;
  static bool is_same(const Trial& a, const Trial& view);
  static bool is_alone(std::span<const Trial> trials, const Trial& view);
  static double agreement(std::span<const Trial> trials, const Trial& view);

  HypothesisMotion motion_;
  const ContourIndex& index_;
  const ContourSegments& segments_;
  const Camera& camera_;
  AdjustedCamera* adjusted_;
  VisibleSetConfig visible_config_;
  EventRegistrationConfig registration_config_;
  ContourSegments edges_;
  std::vector<std::int8_t> side_;  ///< of each map point: +1 or -1, which way an error of its edge counts
  EventIntervals intervals_;
  std::vector<ContourSample> samples_;
  Eigen::VectorXd last_moved_;  ///< of the view that the last call found; empty: there was none
  std::uint32_t last_us_ = 0;   ///< when that was
  int confirmed_in_a_row_ = 0;  ///< of the last calls' views, each the one before it
};

}  // namespace evpose
