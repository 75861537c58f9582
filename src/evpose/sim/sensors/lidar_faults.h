// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "evpose/io/maps/ply.h"
#include "evpose/sim/flight/trajectory.h"

namespace evpose::sim {

struct LidarConfig;

/// Error of the registered pose of each scan by drift: a random walk over the way, of place and, as seen from
/// 10 m, of attitude alike. Place: added to the scan, map frame; attitude: a turn about the sensor.
std::vector<Pose> registration_drift(const Trajectory& trajectory, const LidarConfig& config,
                                     std::uint64_t seed);

/// Drops the points of `fraction` of the scanned surface (cells of 10 cm), in parts of 0.3 to 1.5 m radius at
/// random places: what stood in the way, or where nobody went.
void leave_out_parts(double fraction, std::uint64_t seed, std::vector<CloudPoint>& cloud);

}  // namespace evpose::sim
