// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/tracker_config.h"

#include "evpose/core/config.h"

namespace evpose {

void describe(ConfigTable& table, TrackerConfig& c) {
  table.add("rate_hz", c.rate_hz, "Hz", "updates per second of data time", {1, 5000});
  table.add("threads", c.threads, "",
            "from two on, one thread chooses the contour points; the result is the same for any number",
            {1, 64});
  table.group("events", c.events);
  table.group("visible", c.visible);
  table.add("registration.kind", c.registration,
            {{"events", RegistrationKind::events}, {"temporal_field", RegistrationKind::temporal_field}},
            "each event once against the moving contours, or contours in the temporal distance field "
            "(EV-Pose 4.2)");
  table.group("registration", c.event_registration);
  table.group("temporal_field", c.temporal_field);
  table.group("frames", c.frames);
  table.group("fusion", c.fusion);
  table.group("imu", c.imu);
  table.group("relocalization", c.relocalization);
  table.group("health", c.health);
}

}  // namespace evpose
