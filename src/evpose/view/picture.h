// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "evpose/event/time_surface.h"
#include "evpose/tracker/snapshot.h"

namespace evpose {

inline constexpr double kPictureDecay_s = 0.02;

/// A picture for the page, a quarter of a megapixel at most: u32 width, height, points; f32 seconds; then a
/// byte for each pixel (128: nothing; more: on, less: off, the newer the further), zeros up to a multiple of
/// four, and for each point f32 x, y in the picture's pixels and 1 if it is matched with events, else 0.
std::string picture_bytes(const TimeSurface& surface, std::uint32_t now_us,
                          std::span<const Snapshot::Point> points, double t_s);

}  // namespace evpose
