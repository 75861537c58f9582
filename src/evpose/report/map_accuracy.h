// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/core/pose.h"
#include "evpose/map/contour_map.h"

namespace evpose {

/// How well a view can tell its pose, from the information bound.
struct ViewAccuracy {
  double worst_mm = 0;   ///< 1 sigma of the position along its worst axis; infinite when it cannot be told
  double mean_mm = 0;    ///< square root of the mean variance of the three axes
  double angle_deg = 0;  ///< 1 sigma about the worst axis
  Eigen::Vector3d worst_axis = Eigen::Vector3d::Zero();  ///< of the position, map frame, unit
  std::size_t points = 0, clusters = 0;                  ///< visible points; groups that share an error
};

/// Bound for the pose from visible contour points, each telling the distance across its contour. Points of
/// one 32 px cell and one of four directions share an error of 0.35 px and the map's own sigma: they count as
/// one.
ViewAccuracy expected_accuracy(const ContourMap& map, std::span<const std::uint32_t> points,
                               const Camera& camera, const Pose& T_map_cam);

/// Accuracies over a horizontal grid, at one height: the median of the views to +x, +y, -x, -y, all pitched
/// down.
struct AccuracySlice {
  double height_m = 0;  ///< z of the cameras, map frame
  int columns = 0, rows = 0;
  double x0 = 0, y0 = 0, cell_m = 0;
  std::vector<ViewAccuracy> cells;  ///< row by row, from y0 upwards
};

struct AccuracySurvey {
  std::vector<AccuracySlice> slices;
  double query_ms = 0;          ///< mean time of a fresh visible set
  std::size_t index_bytes = 0;  ///< of the spatial index
};

/// Shares of a survey's cells, 0..1, in which a pose is told to so many mm along its worst axis.
struct AccuracyShares {
  double to_5mm = 0, to_15mm = 0, to_50mm = 0;
  double none = 0;  ///< tell no position: worse than a metre
};
AccuracyShares shares_of(const AccuracySlice& slice);
AccuracyShares shares_of(const AccuracySurvey& survey);

/// The camera that surveys are made with: 640 x 480 pixels of 460 px focal length.
const Camera& survey_camera();
/// Heights at which a map is surveyed unless told: a quarter and half of its own.
std::vector<double> survey_heights(const ContourMap& map);

/// Slices over the map's bounds at the heights given, `cells` along the longer side.
AccuracySurvey survey_accuracy(const ContourMap& map, const Camera& camera, double pitch_down_rad,
                               std::span<const double> heights_m, int cells);

}  // namespace evpose
