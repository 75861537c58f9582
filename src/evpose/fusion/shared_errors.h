// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>

namespace evpose {

class JointMeasurement;
struct BlockSample;
struct ContourOffset;

/// Errors that the contours of one flight share, so that they do not average out: how late the events come
/// where the light is dim, and by how much all edges of one direction stand off (light and shade beside an
/// edge, contrast that the edge delay does not know, faces that a map has in the wrong place). The filter's
/// gain does not know of them. What they do to its estimate is followed
/// (ErrorStateFilter::follow_shared_errors) and belongs to the pose's covariance.
///
/// Estimated by the filter instead, they and a pose that drifts along its motion confirm each other; over a
/// whole flight, which sees every direction from many places, they can be told apart; there an offset is one
/// number, which clutter does not change.
struct SharedErrors {
  static constexpr int kDirections = 8;           ///< of the darker side in the image
  static constexpr int kCount = 1 + kDirections;  ///< the delay, and an offset for each direction

  /// One of them, and by how much one sigma of it moves a sample's residual.
  struct Effect {
    int number;
    double px;
  };
  /// On this contour: of the delay, and of the offset of its direction.
  static std::array<Effect, 2> on(const ContourOffset& contour);
  /// Adds them to this contour's sample, the offset larger where many events of the update are of no contour.
  static void add(const ContourOffset& contour, const BlockSample& sample, JointMeasurement& measurement);
};

}  // namespace evpose
