// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/landmark_search.h"

#include <algorithm>
#include <utility>

namespace evpose {
namespace {

constexpr double kCell_px = 3;  // of the depths
constexpr double kNear_m = 0.1, kWidestTangent = 3;

/// Out to where the camera sees, on the plane at unit depth.
Eigen::Vector2d tangents_of(const Camera& camera) {
  const double right = camera.size().width - 1, bottom = camera.size().height - 1;
  Eigen::Vector2d out(0.1, 0.1);
  for (const double u : {0.0, 0.5, 1.0})
    for (const double v : {0.0, 0.5, 1.0}) {
      const auto ray = camera.unproject({u * right, v * bottom});
      if (ray && ray->z() > 0) out = out.cwiseMax(ray->head<2>().cwiseAbs() / ray->z());
    }
  return out.cwiseMin(kWidestTangent);
}

double cell_of(const Camera& camera) { return kCell_px * 2 * tangents_of(camera).x() / camera.size().width; }

}  // namespace

LandmarkSearch::LandmarkSearch(const ContourIndex& index, const Camera& camera)
    : index_(index), finder_(camera.size()), depths_(tangents_of(camera), cell_of(camera)) {}

void LandmarkSearch::begin(std::vector<FilteredEvent>& slice, std::uint32_t now_us, const Pose& T_map_cam) {
  finish();
  slice_.clear();
  std::swap(slice_, slice);
  now_us_ = now_us;
  T_map_cam_ = T_map_cam;
  begun_ = true;
}

void LandmarkSearch::launch() {
  if (begun_ && !job_.valid()) job_ = std::async(std::launch::async, [this] { run(); });
}

void LandmarkSearch::run() {
  pieces_ = finder_.find(slice_, now_us_);
  depths_.render(index_.map(), T_map_cam_, kNear_m);
}

void LandmarkSearch::finish() {
  if (!std::exchange(begun_, false)) return;
  if (job_.valid())
    job_.get();
  else
    run();
}

}  // namespace evpose
