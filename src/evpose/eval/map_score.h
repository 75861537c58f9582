// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "evpose/map/contour_map.h"

namespace evpose {
struct PointCloud;

struct MapScoreConfig {
  double long_m = 0.3;                 ///< true edges shorter than this do not count for recall
  double reach_m = 0.03;               ///< contours further apart are different ones
  double direction_rad = 0.26;         ///< so are those that differ more in direction
  double seen_radius_m = 0.05;         ///< around a true point; larger for a sparse cloud
  int seen_points = 6;                 ///< of the cloud within that radius: the true point was seen
  std::vector<Eigen::Vector3d> flown;  ///< places, to tell recall by the distance from the nearest of them
};

/// Shares and distances are weighted by length.
struct KindScore {
  double built_m = 0, true_m = 0;                ///< lengths; true: long and seen
  double precision_5mm = 0, precision_10mm = 0;  ///< of what was built, the share so near to a true contour
  double recall_5mm = 0, recall_10mm = 0;        ///< of what is true, the share so near to a built contour
  double p50_mm = 0, mean_mm = 0, p95_mm = 0;    ///< across, of what was built within reach of a true contour
  double direction_mean_deg = 0, direction_p95_deg = 0;
  double sigma_ratio = 0;  ///< rms of distance / stated sigma, of what is within reach; 1 is consistent
  /// The same of the better half, and the share beyond 3.5 sigma: contours that sit on another edge.
  double sigma_bulk = 0, outliers = 0;
};

/// Recall of the true edges of one class.
struct RecallClass {
  double from = 0;    ///< metres; to the next class'
  double true_m = 0;  ///< length that counts
  double recall_5mm = 0, recall_10mm = 0;
};

struct MapScore {
  KindScore all, crease, boundary;
  std::array<RecallClass, 4> by_length{{{0.3}, {0.6}, {1.2}, {2.4}}};
  /// By the distance of the nearest other true edge that runs parallel: mostly the width of the narrower face
  /// at the edge, which a cloud must show in spite of its noise and with its spacing.
  std::array<RecallClass, 6> by_parallel_edge{{{0}, {0.03}, {0.05}, {0.08}, {0.15}, {0.3}}};
  std::array<RecallClass, 4> by_distance_flown{{{0}, {2}, {4}, {8}}};  ///< from what was flown; empty without
  double unseen_m = 0, short_m = 0;  ///< true contours that do not count for recall
};

/// Compares contours point by point. The distance from a true contour is that across it. `cloud`: what the
/// map was built from, to tell which true edges it saw; nullptr: all. Both maps must have tangents and
/// lengths; view-dependent contours do not count.
MapScore score_map(const ContourMap& judged, const ContourMap& truth, const PointCloud* cloud,
                   const MapScoreConfig& config);

}  // namespace evpose
