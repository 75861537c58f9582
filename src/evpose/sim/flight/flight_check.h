// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>

#include "evpose/core/error.h"
#include "evpose/sim/flight/motion.h"
#include "evpose/sim/light/ray_caster.h"

namespace evpose::sim {

/// Checks a flight before it is rendered. Errors, with the time: the camera is inside of a body or nearer
/// than 3 cm to a surface or a pane; the optical flow exceeds `max_flow_px_s`.
Status check_flight(const RayCaster& rays, const CameraPath& path, double duration_s, double focal_px,
                    double max_flow_px_s);

}  // namespace evpose::sim
