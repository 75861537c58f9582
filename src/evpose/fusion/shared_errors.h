// SPDX-License-Identifier: BSD-3-Clause
#pragma once

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
/// Estimated instead, they and a pose that drifts along its motion confirm each other.
struct SharedErrors {
  static constexpr int kDirections = 8;           ///< of the darker side in the image
  static constexpr int kCount = 1 + kDirections;  ///< the delay, and an offset for each direction

  /// Adds what they do to this contour's sample.
  static void add(const ContourOffset& contour, const BlockSample& sample, JointMeasurement& measurement);
};

}  // namespace evpose
