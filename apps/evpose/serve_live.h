// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "evpose/mavlink/reporter.h"
#include "evpose/run/track_recording.h"
#include "evpose/serve/replay_source.h"
#include "evpose/serve/session.h"
#include "evpose/serve/stream_queue.h"

namespace evpose {

/// How the map lies in the world and the body on the vehicle, where the recording does not say.
struct FramesConfig {
  double map_heading_deg = 90;  ///< compass heading of the map's x axis; 90: the map is ENU
  double vehicle_x_m = 0, vehicle_y_m = 0, vehicle_z_m = 0;  ///< the vehicle's origin in the body's axes
  double vehicle_roll_deg = 0, vehicle_pitch_deg = 0, vehicle_yaw_deg = 0;  ///< its axes against the body's
};

struct ServeConfig {
  RunConfig run;
  ReplayConfig replay;
  QueueConfig queue;
  SessionConfig session;
  MavlinkConfig mavlink;
  FramesConfig frames;
  std::string view_address = "127.0.0.1";
};
void describe(ConfigTable& table, ServeConfig& config);

struct ServeRequest {
  TrackRequest track;   ///< recording: a recording, or the address of a source; output may be empty
  std::string mavlink;  ///< address of a link; empty: none
  int view = -1;        ///< port of the viewer; -1: none
};

Expected<ServeConfig> load_serve_config(const TrackRequest& request);

/// Serves until the source ends or the program is interrupted; the exit status.
Expected<int> serve(const ServeRequest& request);

}  // namespace evpose
