// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/core/pose.h"
#include "evpose/event/event_front.h"
#include "evpose/registration/contrast_memory.h"
#include "evpose/registration/flow_monitor.h"
#include "evpose/registration/strip_index.h"

namespace evpose {

class ConfigTable;

struct EventAlignmentConfig {
  double gate_px = 0.5;  ///< an event belongs to a contour within this distance and two sigma of the map
  double widest_gate_px = 0.55;    ///< ... opened by two sigma of the prediction, but to no more than this
  double event_sigma_px = 0.7;     ///< scatter of a contour's events about it
  double shared_sigma_px = 0.35;   ///< error that neighbouring events share (clutter, lateness)
  double shared_s = 0.025;         ///< ... and that lasts so long
  double map_sigma_m = 0.5e-3;     ///< of map points that state no sigma
  bool lateness = true;            ///< events come after the contour
  double lateness_from_px_s = 20;  ///< normal flow below which lateness fades out
  bool polarity = true;            ///< leave out events of the polarity that contrast and flow exclude
  double sure_steps = 0.3;         ///< ... where the contrast is at least so many thresholds
  double buffer_sigma = 3;         ///< ... and the normal flow this many sigma from zero
  double count_px = 1.5;           ///< events so near teach the contrast
  ContrastConfig contrast;
  FlowConfig flow;
  double strip_px = 4;  ///< half length along the contour that a sample stands for
  double ambiguity_px =
      1.0;                   ///< events between two contours, with distances as similar as this, are left out
  int cluster_px = 32;       ///< cells whose events share an error, at 640 px width
  bool honest_slope = true;  ///< take off what the gate hides of an offset
};
void describe(ConfigTable& table, EventAlignmentConfig& config);

/// A visible contour sample and its motion over the events' span.
struct ContourSample {
  Eigen::Vector2d pixel;        ///< at the time of the update, predicted
  Eigen::Vector2d normal_px;    ///< unit, across the contour
  double speed_px_s = 0;        ///< s1: normal . velocity of the contour in the image
  double curvature_px_s2 = 0;   ///< s2: normal . (u(t - a) - u(t)) = -s1 a + s2 a^2 for age a
  Vector6d jacobian;            ///< derivative of an event's signed distance by the pose perturbation
  double map_sigma_px = 0;      ///< the map's error across the contour, in the image
  double speed_sigma_px_s = 0;  ///< error of the speed, 1 sigma
  std::uint32_t piece = 0;      ///< of the contour, for what is learnt about it
  std::uint32_t point = 0;      ///< of the map
  double flow_px_s = 0;         ///< velocity in the image, in any direction
  double depth_m = 0;           ///< distance from the camera
};

/// What the alignment made of an event.
enum class EventVerdict : std::uint8_t {
  elsewhere,       ///< near no contour, or between two
  beside,          ///< near a contour, outside the gate
  wrong_polarity,  ///< in the gate, but of the excluded polarity
  other_motion,    ///< in the gate of a cell whose events do not move as the ego-motion says
  contour,         ///< used
  predicted,       ///< used, and of the polarity that was predicted
};

struct EventAlignmentProblem {
  std::span<const FrontEvent> events;  ///< kept since the last update
  std::uint32_t now_us;                ///< time of the update, on the events' clock
  double span_s;                       ///< since the last update
  std::span<const ContourSample> samples;
  const Matrix6d& pose_covariance;                ///< of the prediction
  const TimeSurface* surface = nullptr;           ///< with these events; none: flow is not looked at
  std::vector<EventVerdict>* verdicts = nullptr;  ///< of each event, if asked for
};

/// What the events of one sample ask for: that the pose moves its contour by `offset_px`.
struct SampleOffset {
  std::size_t sample;
  double offset_px, weight;  ///< weight: px^-2, as it enters the information
};

struct EventAlignmentResult {
  Matrix6d information = Matrix6d::Zero();  ///< relative to the predicted pose
  Vector6d vector = Vector6d::Zero();       ///< information * offset
  int matched_samples = 0;                  ///< with at least one event in the gate
  int matched_events = 0;
  double slope = 1;  ///< how the mean distance answers to an offset: 0 for events spread evenly, or too few
  bool captured = true;        ///< the events in the gate gather at the contours
  int wrong_polarity = 0;      ///< events near contours that were left out for their polarity
  int other_motion = 0;        ///< events in the gate of cells that are mistrusted, by more than a half
  double mean_square_px2 = 0;  ///< weighted, of the signed distances
};

/// Registration of each event once, at its own time, against the moving contours: the distance field of
/// EV-Pose 4.2 turned round. An event at x of age a has the signed distance
///   d = n.(x - u) + s1 a - s2 a^2 + lateness sign(s1)
/// from the contour sample that claims its pixel; d is zero-mean Gaussian for events of the contour and
/// uniform over the gate for clutter (soft assignment). The gate is tight: a wide one was measured to hand
/// the pose to texture beside the contours. It follows the map's sigma. A gate hides part of an offset, as
/// those events that the offset moves out of it no longer tell of it: the slope of the mean distance is
/// measured by the density at the gate, so that the information is not over-stated. Events of a cell and
/// direction share errors that last; their information is capped accordingly.
class EventAlignment {
 public:
  /// `pieces`: of the contours; the samples' numbers are below it.
  EventAlignment(ImageSize size, const EventAlignmentConfig& config, std::uint32_t pieces = 1);
  EventAlignmentResult align(const EventAlignmentProblem& problem);

  /// The pose comes from elsewhere: how well the events gathered at the contours does not count any more.
  void forget() { slope_ = {}; }
  /// Of the last call: its information and vector, sample by sample.
  std::span<const SampleOffset> offsets() const { return offsets_; }
  const ContrastMemory& contrast() const { return contrast_; }

 private:
  /// What an event needs to know of the sample that it belongs to.
  struct Line {
    float late_on, late_off;          ///< px, along the normal
    float gate;                       ///< px
    float exponent, odds;             ///< exp(exponent d^2) * odds: of the contour against clutter
    std::int8_t wrong_on, wrong_off;  ///< polarity excluded
    std::int8_t forward;              ///< +1 if the contour moves along its normal, else -1
  };
  struct Sum {
    double weight = 0, offset = 0, square = 0;
    int events = 0, net = 0;    ///< net: events near by, for the contrast
    int agree = 0, differ = 0;  ///< events in the gate that move as predicted, or not
  };
  /// How the mean distance answers to an offset: sums over events, slowly forgotten.
  struct Slope {
    double weight = 0, inside = 0, at_gate = 0;
    double value() const;
  };
  struct Cluster {
    double weight = 0, map_variance = 0, trust = 1;
  };
  void prepare(const EventAlignmentProblem& problem);
  void sum_events(const EventAlignmentProblem& problem, EventAlignmentResult* result);
  void learn_contrast(const EventAlignmentProblem& problem);
  void watch_flow(const EventAlignmentProblem& problem);
  void weigh_clusters(const EventAlignmentProblem& problem, EventAlignmentResult* result);
  void tell_other_motion(const EventAlignmentProblem& problem);
  std::uint32_t cluster_of(const ContourSample& sample) const;
  bool captured() const;
  bool polarity_is_wrong(const ContourSample& sample, int sign) const;
  bool owns_a_place(std::size_t sample, float half_span_us) const;

  ImageSize size_;
  EventAlignmentConfig config_;
  StripIndex index_;
  ContrastMemory contrast_;
  FlowMonitor flow_;
  Slope slope_;
  // Of the last call, one for each sample; kept so that nothing is allocated from call to call.
  std::vector<Strip> strips_;
  std::vector<Line> lines_;
  std::vector<StripIndex::Found> found_;
  std::vector<Sum> sums_;
  std::vector<SampleOffset> offsets_;
  std::vector<Cluster> clusters_;
  std::vector<std::uint32_t> cluster_numbers_;
  std::vector<std::int32_t> owners_;  ///< of the events, if verdicts are asked for
  std::uint32_t call_ = 0;
};

}  // namespace evpose
