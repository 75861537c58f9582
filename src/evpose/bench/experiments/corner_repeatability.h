// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evpose/bench/experiments/recordings.h"

namespace evpose::experiments {

/// How often what is seen in 5 ms of events is seen again 10, 50 and 100 ms later where the truth says it
/// must be (to 3 px): corners in the events (Arc*), whose depth is that of the mesh, and points of the map's
/// contours. Beside each the share that is "seen again" at the mirrored place of the image, by chance.
Status print_corner_repeatability(const Selection& selection);

}  // namespace evpose::experiments
