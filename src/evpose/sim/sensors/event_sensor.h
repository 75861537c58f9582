// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "evpose/core/error.h"
#include "evpose/sim/sensors/event_pixels.h"
#include "evpose/sim/sensors/read_out.h"

namespace evpose {
class ConfigTable;
}

namespace evpose::sim {

/// Kinds of event cameras; docs/use/simulator.md gives the source of each number.
enum class EventSensorPreset : std::uint8_t {
  typical,    ///< a sane middle
  imx636,     ///< 1280 x 720, 4.86 um, stacked
  dvxplorer,  ///< 640 x 480, 9 um, scanned in frames
  davis346,   ///< 346 x 260, 18.5 um
};

/// Pixels of a sensor. -1 is replaced by the value of the preset.
struct EventSensorConfig : EventCameraConfig {
  EventSensorConfig();
  EventSensorPreset preset = EventSensorPreset::typical;
};
void describe(ConfigTable& table, EventSensorConfig& config);

/// The configs with the values of the preset where they have none. Errors: a negative value but -1, a
/// threshold so small that rounding would trigger it.
Expected<EventSensorConfig> with_preset_values(const EventSensorConfig& config);
ReadOutConfig with_preset_values(const ReadOutConfig& config, EventSensorPreset preset);

}  // namespace evpose::sim
