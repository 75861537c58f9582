// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <future>
#include <span>
#include <vector>

#include "evpose/event/event_preprocessor.h"
#include "evpose/map/contour_index.h"
#include "evpose/map/depth_buffer.h"
#include "evpose/registration/edge_pieces.h"

namespace evpose {

/// Finds pieces of edges in a slice of events, and which surfaces of the map are seen there: tens of
/// milliseconds of a core where many events come, in a thread of its own. Asked for its result, it gives the
/// same, whether that was there already or not.
class LandmarkSearch {
 public:
  /// References are kept.
  LandmarkSearch(const ContourIndex& index, const Camera& camera);
  ~LandmarkSearch() { finish(); }
  LandmarkSearch(const LandmarkSearch&) = delete;
  LandmarkSearch& operator=(const LandmarkSearch&) = delete;

  /// In events up to `now_us`, which are taken over; `slice` gets an empty vector for them.
  void begin(std::vector<FilteredEvent>& slice, std::uint32_t now_us, const Pose& T_map_cam);
  /// It may cost time from now on.
  void launch();
  /// Has looked at all that it needs: map and events may change.
  void finish();

  /// After finish().
  std::span<const EdgePiece> pieces() const { return pieces_; }
  /// After finish(): seen from the camera's pose at the end of the slice.
  const DepthBuffer& depths() const { return depths_; }

 private:
  void run();

  const ContourIndex& index_;
  EdgePieceFinder finder_;
  DepthBuffer depths_;
  std::vector<FilteredEvent> slice_;
  std::uint32_t now_us_ = 0;
  Pose T_map_cam_;
  std::vector<EdgePiece> pieces_;
  bool begun_ = false;     ///< and not finished
  std::future<void> job_;  ///< uses all of the above
};

}  // namespace evpose
