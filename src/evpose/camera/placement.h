// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "evpose/core/pose.h"

namespace evpose {

/// Where a camera sits and looks on a body whose axes are x forward, y left, z up, for people to compare with
/// the hardware: "12 mm ahead, 3 mm left, 40 mm above; looks forward, 33 deg down, upright". Parts below half
/// a millimetre or half a degree are left out.
std::string placement_in_words(const Pose& T_body_cam);

}  // namespace evpose
