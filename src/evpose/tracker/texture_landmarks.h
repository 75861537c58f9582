// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "evpose/event/event_preprocessor.h"
#include "evpose/event/interest_map.h"
#include "evpose/fusion/back_end.h"
#include "evpose/map/contour_index.h"
#include "evpose/registration/contour_view.h"
#include "evpose/registration/event_registration.h"
#include "evpose/tracker/landmark_search.h"
#include "evpose/tracker/landmark_view.h"

namespace evpose {

/// Edges that a map lacks, on surfaces that it has: prints, stains, rims of tiles. Pieces of them are found
/// in the events of some milliseconds and placed on the surface that is seen there, which takes 10 ms; for a
/// tenth of a second events are measured against them like against contours. They do not tell where the
/// camera is in the map, but how it has moved since they were found: the fusion keeps the pose of that time
/// as a further state. Where most events are of what the map lacks, contours alone hold the pose badly, and
/// biases of the IMU that are not yet known carry it off.
class TextureLandmarks {
 public:
  /// References are kept.
  /// `adjusted`: the camera if its numbers are estimated, else null.
  TextureLandmarks(const ContourIndex& index, const Camera& camera, const Pose& T_body_cam,
                   const AdjustedCamera* adjusted);

  /// The pose comes from elsewhere, or is not measured: landmarks go.
  void restart();
  /// Before the events of the next update come: which of them are to be collected for it.
  void prepare(TimeNs next_update, EventPreprocessor& events);
  /// Before the map's index changes.
  void let_go_of_map() { search_.finish(); }
  /// The same, with the landmarks as they will be seen then, found at a pose as it is known now.
  void expect(const FusionState& coming, double span_s, const Pose& found_at);
  /// As Registration::look_at, at what was collected.
  void look_at(std::uint32_t now_us);

  /// One update.
  struct Input {
    TimeNs t;
    std::uint32_t now_us;
    double span_s;             ///< since the last update
    const NavState* forecast;  ///< that was expected, unless null
    double flow_px_s;          ///< of the image, typical
  };
  /// Measures the landmarks, and finds new ones when it is time.
  void update(const Input& input, BackEnd& fusion);

  std::size_t size() const { return landmarks_.size(); }

 private:
  struct Landmark {
    Eigen::Vector2d pixel;  ///< at the mean time of its events
    double depth_m;         ///< there and then
    Pose T_kept_then;       ///< of the body, from then to when the pose was kept
    Eigen::Vector3d ray;    ///< of the pixel, at unit depth
    Eigen::Vector3d tangent_cam;
  };

  bool finding() const { return seen_from_.has_value(); }
  void find(const Input& input, BackEnd& fusion);
  void take_found();
  std::optional<Eigen::Vector3d> surface_at(const Eigen::Vector2d& pixel) const;
  void place(const EdgePiece& piece);
  void project(const FusionState& state, double span_s, const Pose& found_at);
  RelativeInformation measure(const Input& input, const BackEnd& fusion);

  const Camera& camera_;
  const Pose& T_body_cam_;
  const AdjustedCamera* adjusted_;
  InterestMap near_;                      ///< where landmarks will be
  std::vector<FilteredEvent> collected_;  ///< since the last update
  std::vector<FilteredEvent> slice_;      ///< in which landmarks will be found
  std::optional<TimeNs> slice_begin_;
  TimeNs found_ = 0;                      ///< when the landmarks were, or began to be missed
  std::optional<FusionState> seen_from_;  ///< at that time, while landmarks are being found
  std::vector<Landmark> landmarks_;
  // As contours of a map of their own.
  ContourMap map_;
  ContourSegments segments_;
  std::vector<ContourSample> samples_;
  std::optional<EventRegistration> registration_;  ///< of these landmarks
  bool expected_ = false;
  LandmarkSearch search_;
};

}  // namespace evpose
