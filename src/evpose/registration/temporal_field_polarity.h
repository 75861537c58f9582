// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "evpose/event/time_surface.h"
#include "evpose/registration/contour_view.h"
#include "evpose/registration/contrast_memory.h"
#include "evpose/registration/temporal_field.h"

namespace evpose {

struct PolarityConfig {
  bool on = true;           ///< off: events of both polarities count everywhere
  double buffer_sigma = 3;  ///< half width of the buffer zone, in sigma of the normal flow
};

/// The angle test of EV-Pose 5.1 at one contour point. The gradient g of brightness points to the brighter
/// side; the flow f is the point's motion in the image. Brightness changes by -g . f: events are on where the
/// two point against each other.
struct AngleTest {
  double cos_theta = 0;  ///< g . f / (|g| |f|); g is across the contour, whatever the map's 3D gradient is
  double buffer = 0;     ///< events of both polarities count where |cos_theta| is not above this
};
/// `brighter_side`: +1 if it is brighter where sample.normal_px points, else -1. The buffer zone is adaptive:
/// it is the angle within which the sign of the normal flow is less than `buffer_sigma` from certain.
AngleTest test_angle(const ContourSample& sample, int brighter_side, double buffer_sigma);

/// The time surface that the point is matched with: both in the buffer zone and where the contrast's sign is
/// not known.
FieldPolarity predicted_polarity(const ContourSample& sample, const ContrastMemory& contrast,
                                 const PolarityConfig& config);

/// Pixels at a sample that had an event since the last update.
struct SampleEvents {
  int on = 0, off = 0;
  double swept_px2 = 0;  ///< image area that the contour has swept where these were counted
};
SampleEvents events_at(const TimeSurface& surface, const ContourSample& sample, std::uint32_t now_us,
                       double span_s);

}  // namespace evpose
