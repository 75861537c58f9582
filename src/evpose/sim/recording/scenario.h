// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>

#include "evpose/core/error.h"
#include "evpose/sim/flight/trajectory.h"
#include "evpose/sim/recording/handed_over.h"
#include "evpose/sim/sensors/camera_rig.h"
#include "evpose/sim/sensors/event_sensor.h"
#include "evpose/sim/sensors/frame_camera.h"
#include "evpose/sim/sensors/imu_sensor.h"
#include "evpose/sim/sensors/lidar.h"
#include "evpose/sim/sensors/pixel_integrator.h"
#include "evpose/sim/sensors/read_out.h"
#include "evpose/sim/world/worlds.h"

namespace evpose::sim {

/// Switching of all lamps of a world, including their ambient light.
struct LampConfig {
  double off_at_s = -1, on_at_s = -1;  ///< negative: never
  double off_factor = 0.02;            ///< remaining fraction when they are off
  double fade_ms = 2;
  double flicker_hz = 0;  ///< of the light: twice the mains frequency
  double flicker_depth = 0.12;
};
void describe(ConfigTable& table, LampConfig& config);

struct TruthConfig {
  double rate_hz = 1000;  ///< of groundtruth.tum
  bool events = false;    ///< events_truth.h5
  double contour_spacing_m = 0.01;
};
void describe(ConfigTable& table, TruthConfig& config);

/// All settings of a recording.
struct Scenario {
  std::string name = "flight", description;
  int seed = 1;  ///< of the sensors' noise; world and trajectory have their own
  double duration_s = 3;
  std::string scene_file;  ///< custom scene; empty: `world`
  WorldConfig world;
  LampConfig lamps;
  TrajectoryConfig trajectory;
  CameraConfig camera;
  PixelIntegratorConfig integrator;
  EventSensorConfig events;
  ReadOutConfig read_out;
  ImuConfig imu;
  FramesConfig frames;
  DepthConfig depth;
  LidarConfig lidar;
  HandedOverConfig handed_over;
  TruthConfig truth;
};
void describe(ConfigTable& table, Scenario& scenario);

/// With the values of presets for `events`, `read_out` and `handed_over`. Errors: a value out of its range.
Expected<Scenario> with_preset_values(const Scenario& scenario);

}  // namespace evpose::sim
