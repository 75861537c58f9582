// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "evpose/core/pose.h"
#include "evpose/event/event_preprocessor.h"
#include "evpose/event/interest_map.h"
#include "evpose/registration/block_thinning.h"
#include "evpose/registration/contour_view.h"

namespace evpose {

class ContrastMemory;

enum class RegistrationKind {
  events,          ///< each event once, at its own time, against the moving contours
  temporal_field,  ///< EV-Pose eq. (1): the temporal distance field, sampled at the contours
};

/// What the registration made of an event.
enum class EventVerdict : std::uint8_t {
  elsewhere,       ///< near no contour, or between two
  beside,          ///< near a contour, outside the gate
  wrong_polarity,  ///< in the gate, but of the excluded polarity
  other_motion,    ///< in the gate of a cell whose events do not move as the ego-motion says
  contour,         ///< used
  predicted,       ///< used, and of the polarity that was predicted
};

/// What the next measurement will be made with, as far as is known before its events come.
struct RegistrationForecast {
  std::span<const ContourSample> samples;  ///< as they will be seen
  double span_s;                           ///< until then
  BlockThinning thinning = {};             ///< where events will be looked at
  double aside_px = 0;                     ///< so far beside the contours they matter, too
  Matrix6d pose_covariance = Matrix6d::Zero();
};

/// By how much the prediction differs from the forecast that its samples were made for.
struct ForecastError {
  Vector6d pose = Vector6d::Zero();                    ///< as Pose::plus
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  ///< map frame, m/s
};

/// What one measurement is made from.
struct RegistrationProblem {
  std::span<const FilteredEvent> events;  ///< kept since the last update
  std::uint32_t now_us;                   ///< time of the update, on the events' clock
  double span_s;                          ///< since the last update
  std::span<const ContourSample> samples;
  const Matrix6d& pose_covariance;                ///< of the prediction
  const TimeSurface* surface = nullptr;           ///< with these events; null unless reads_surface()
  const ContourView* view = nullptr;              ///< that the samples were made with
  Pose T_map_body = {};                           ///< the prediction
  std::vector<EventVerdict>* verdicts = nullptr;  ///< of each event, if asked for
  std::optional<ForecastError> forecast =
      {};                       ///< the samples are those of expect(), which has seen all events
  BlockThinning thinning = {};  ///< where events were looked at
};

/// What one measurement says. Near the predicted pose its cost is d^T information d / 2 - vector^T d, with d
/// as in Pose::plus.
struct RegistrationResult {
  Matrix6d information = Matrix6d::Zero();
  Vector6d vector = Vector6d::Zero();
  double residual = 0;     ///< RMS of event distances, px; of the temporal field's robust loss, 0..1
  int points = 0;          ///< contour samples that were compared
  int inliers = 0;         ///< of these, with events
  int events = 0;          ///< in the gates of the samples
  int wrong_polarity = 0;  ///< events near contours that were left out for their polarity
  int other_motion = 0;    ///< events in the gate of cells that are mistrusted, by more than a half
  bool converged = true;
  /// 1: all events in the gates lie at the contours; 0: evenly over the gates, or too few to tell.
  double gate_concentration = 1;
  bool consistent = true;  ///< the events in the gates concentrate at the map's contours
};

/// What the events of one sample ask for: that the pose moves its contour by `offset_px`.
struct SampleOffset {
  std::size_t sample;
  double offset_px, weight;  ///< weight: px^-2, as it enters the information
};

/// Measures the pose by events and contours.
class Registration {
 public:
  Registration() = default;
  Registration(const Registration&) = delete;
  Registration& operator=(const Registration&) = delete;
  virtual ~Registration() = default;

  virtual RegistrationResult measure(const RegistrationProblem& problem) = 0;

  /// The events up to the next measurement may be looked at as they come. Marks where they matter; false if
  /// they matter everywhere and only the measurement itself looks at them.
  virtual bool expect(const RegistrationForecast&, InterestMap*) { return false; }
  /// All events since expect(), those of the last call among them; `now_us`: time of the measurement.
  virtual void look_at(std::span<const FilteredEvent>, std::uint32_t /*now_us*/) {}

  /// What the last measurement teaches of the contours, for later ones: the pose need not wait for it. To be
  /// called after each with a forecast, with its samples and span.
  virtual void learn(std::span<const ContourSample>, double /*span_s*/) {}

  /// The pose comes from elsewhere: how well events met the contours until now does not count any more.
  virtual void restart() {}
  /// Whether `measure` wants the time surface.
  virtual bool reads_surface() const = 0;
  /// Of the last measurement: its information and vector, sample by sample; none if it is no sum over
  /// samples.
  virtual std::span<const SampleOffset> offsets() const { return {}; }
  /// The contrast segments are those of another part of the map from now on; see ContrastMemory. What the map
  /// says of the sign of each, of which the new ones learn.
  virtual void rearrange_segments(std::span<const std::uint32_t> before,
                                  std::span<const int> map_contrast) = 0;
  /// What has been learnt of the contours' contrast; null if nothing is.
  virtual const ContrastMemory* contrast() const { return nullptr; }
};

}  // namespace evpose
