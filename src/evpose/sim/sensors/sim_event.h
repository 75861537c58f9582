// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "evpose/core/time.h"

namespace evpose::sim {

/// Why a pixel fired.
enum class EventCause : std::uint8_t { signal = 0, leak = 1, shot = 2, hot = 3 };

/// What a pixel looked at when it fired.
enum class EventOrigin : std::uint8_t {
  texture = 0,  ///< within one flat or smooth surface: print, shadow, shading, light
  edge = 1,    ///< a crease or an outline of what stands still runs through the pixel, now or a sample before
  moving = 2,  ///< a moving thing is in the pixel, now or a sample before
};

/// An event with its truth.
struct SimEvent {
  TimeNs t = 0;
  std::uint16_t x = 0, y = 0;
  bool on = false;
  EventCause cause = EventCause::signal;
  EventOrigin origin = EventOrigin::texture;
  std::uint16_t object = 0;  ///< number in Scene::objects of what the pixel's centre sees
};

}  // namespace evpose::sim
