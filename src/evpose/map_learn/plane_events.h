// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <vector>

#include "evpose/core/error.h"
#include "evpose/map_learn/line_detector.h"
#include "evpose/map_learn/trajectory.h"
#include "evpose/run/track_recording.h"

namespace evpose::map_learn {

/// A flight's events laid out on one plane of a map.
struct PlaneEvents {
  int plane = -1;
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();  ///< map frame, of cell (0, 0)
  Eigen::Vector3d right, up;                         ///< unit, in the plane: along the columns and rows
  double cell_m = 0;
  double pixel_m = 0;  ///< typical size of a pixel on the plane
  CountImage image;
};

/// Each event goes on the nearest plane that its pixel sees from the trajectory at its time; what the map has
/// no plane for is left out. Planes with few events are left out. `progress`: as of feed_recording(). Error:
/// of the recording.
Expected<std::vector<PlaneEvents>> events_on_planes(const TrackJob& job, const Trajectory& trajectory,
                                                    const std::function<bool(double)>& progress);

/// Straight edges of what is printed or painted on planes, as contours of unknown contrast and of kind
/// `marking`, numbered from `first_contour` on: those that no contour of the map runs beside.
std::vector<ContourPoint> find_markings(const std::vector<PlaneEvents>& planes, const ContourMap& map,
                                        std::int32_t first_contour);

}  // namespace evpose::map_learn
