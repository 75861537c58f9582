// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evpose/event/event_preprocessor.h"
#include "evpose/fusion/back_end.h"
#include "evpose/map/visible_set.h"
#include "evpose/registration/event_registration.h"
#include "evpose/registration/temporal_field_registration.h"
#include "evpose/tracker/frame_input.h"
#include "evpose/tracker/health.h"
#include "evpose/tracker/imu_gate.h"
#include "evpose/tracker/relocalizer.h"

namespace evpose {

/// All settings of the tracker. Each is described once, with its unit and bounds, by the describe() of its
/// struct.
struct TrackerConfig {
  double rate_hz = 300;
  int threads = 1;
  EventPreprocessorConfig events;
  VisibleSetConfig visible;
  RegistrationKind registration = RegistrationKind::events;
  EventRegistrationConfig event_registration;
  TemporalFieldConfig temporal_field;
  FrameUseConfig frames;
  FusionConfig fusion;
  ImuWatchConfig imu;
  RelocalizationConfig relocalization;
  HealthConfig health;

  // Not for users: the twin that benchmarks and tests compare with.
  bool streams = true;  ///< false: events are associated at the update, not as they come
};
void describe(ConfigTable& table, TrackerConfig& config);

}  // namespace evpose
