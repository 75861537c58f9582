// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "evpose/event/event_preprocessor.h"
#include "evpose/registration/contour_view.h"

namespace evpose {

/// Events and map points of one instant, for pictures.
struct Snapshot {
  ImageSize size;
  std::vector<float> decay;  ///< row-major; > 0 on, < 0 off, exp(-age / decay_s)
  struct Point {
    float x, y;    ///< px
    bool matched;  ///< an event was there less than `decay_s` ago
  };
  std::vector<Point> points;
};

/// The time surface at `now_us`, row-major: > 0 on, < 0 off, exp(-age / decay_s).
std::vector<float> decayed(const TimeSurface& surface, std::uint32_t now_us, double decay_s);

/// Images of map points at a pose. Without a surface none is matched.
std::vector<Snapshot::Point> project_points(const ContourView& view, std::span<const std::uint32_t> points,
                                            const Pose& T_map_body, const TimeSurface* surface,
                                            std::uint32_t now_us, double decay_s);

}  // namespace evpose
