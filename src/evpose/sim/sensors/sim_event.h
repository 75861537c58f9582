// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "evpose/core/time.h"

namespace evpose::sim {

/// Cause of an event.
enum class EventCause : std::uint8_t { signal = 0, leak = 1, shot = 2, hot = 3 };

/// What the pixel saw at the time of the event.
enum class EventOrigin : std::uint8_t {
  texture = 0,  ///< the inside of a flat or smooth surface: print, shadow, shading, light
  edge = 1,     ///< a crease or an outline of the static scene, in this sample or the one before
  moving = 2,   ///< a moving object, in this sample or the one before
};

/// An event with its ground truth.
struct SimEvent {
  TimeNs t = 0;
  std::uint16_t x = 0, y = 0;
  bool on = false;
  EventCause cause = EventCause::signal;
  EventOrigin origin = EventOrigin::texture;
  std::uint16_t object = 0;  ///< number in Scene::objects of the object at the centre of the pixel
};

}  // namespace evpose::sim
