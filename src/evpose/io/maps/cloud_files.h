// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "evpose/core/error.h"
#include "evpose/core/thinned.h"
#include "evpose/map/point_cloud.h"

namespace evpose {

/// What a cloud's file holds, found by reading it through once.
struct CloudSurvey {
  std::string path;
  std::size_t points = 0;                            ///< that are finite
  Eigen::Vector3d anchor = Eigen::Vector3d::Zero();  ///< what its points are told relative to
  std::optional<Eigen::Vector3d> viewpoint;          ///< that the file states
  std::optional<double> brightness_scale;            ///< from the file's numbers to 0..255; none: it has none
  Thinned<Eigen::Vector3d> sample;                   ///< of the points, map frame

  CloudSurvey(std::string file, std::size_t most_sampled) : path(std::move(file)), sample(most_sampled) {}
};

/// `most_sampled`: points of the sample. Points that are not finite are counted in one warning; a size that
/// suggests another unit than metres is warned of. Errors: what the formats' readers say, no points, points
/// beyond 1e7 m.
Expected<CloudSurvey> survey_cloud(const std::string& path, std::size_t most_sampled = 0);

/// The cloud in blocks of some ten thousand points, in the order of the file; `visit` may refuse. PLY and LAS
/// are never in memory as a whole, PCD is.
Status visit_cloud(const CloudSurvey& survey, const std::function<Status(const PointCloud& block)>& visit);

/// A cloud of surface points from PLY, PCD or LAS, by content. Brightness comes from `intensity` (scaled so
/// that its 98th percentile, in large clouds that of a million of them, is nearly white) or from red, green
/// and blue. Points that are not finite are left out. Warnings and errors: as of survey_cloud().
Expected<PointCloud> read_cloud(const std::string& path);

}  // namespace evpose
