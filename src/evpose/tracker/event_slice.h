// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/core/time.h"
#include "evpose/event/event_preprocessor.h"

namespace evpose {

/// Events of some milliseconds that are looked at as one picture: as few as show the contours, so that these
/// hardly move meanwhile.
class EventSlice {
 public:
  explicit EventSlice(int image_width) : image_width_(image_width) {}

  /// Leaves out what was collected; the slice begins at t.
  void restart(TimeNs t);
  void add(std::span<const FilteredEvent> events) {
    events_.insert(events_.end(), events.begin(), events.end());
  }

  /// Enough events have come, or enough time has passed.
  bool complete(TimeNs t) const;
  /// The same for faint edges, too, and edges that move slowly.
  bool complete_with_faint_edges(TimeNs t) const;
  /// So few events that nothing moves.
  bool sparse() const;
  double mean_age_s(std::uint32_t now_us) const;
  std::span<const FilteredEvent> events() const { return events_; }

 private:
  double filled() const;

  int image_width_;
  std::vector<FilteredEvent> events_;
  TimeNs begin_ = 0;
};

/// A common instant of a slice, and how the camera turns.
struct SliceRotation {
  Eigen::Vector3d rate_cam;  ///< rad/s, camera frame
  std::uint32_t now_us;      ///< time of the update, on the events' clock
  double age_s;              ///< of the instant, before now
};

/// Replaces `out` by the events where they would be had the camera not turned between them and the instant;
/// those that leave the image are left out.
void compensate_rotation(std::span<const FilteredEvent> events, const Camera& camera,
                         const SliceRotation& rotation, std::vector<FilteredEvent>& out);

}  // namespace evpose
