// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/run/plausibility.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "evpose/imu/strapdown.h"
#include "evpose/io/motion/imu_axes.h"

namespace evpose {
namespace {

constexpr double kLargest_m = 500;    // places of flights that contours guide are smaller,
constexpr double kSmallest_m = 0.3;   // and larger
constexpr double kOutside_m = 0.5;    // a start so far off the outermost contour may be meant
constexpr double kFlatShare = 0.2;    // of its largest extent: maps that are thinner are a wall or a floor
constexpr double kSteepest_deg = 35;  // between mean specific force and up, in any flight of half a second
constexpr double kLookedAt_s = 0.5;   // of the accelerometer, after the start
constexpr double kLeastLookedAt_s = 0.1;
constexpr double kDegrees = 180 / std::numbers::pi;

struct Box {
  Eigen::Vector3d low, high;  ///< relative to the map's anchor, m
};

Box box_of(const ContourMap& map) {
  Eigen::Vector3f low = map.points.front().position, high = low;
  for (const ContourPoint& p : map.points) low = low.cwiseMin(p.position), high = high.cwiseMax(p.position);
  return {low.cast<double>(), high.cast<double>()};
}

double rounded(double value) { return std::round(10 * value) / 10; }

}  // namespace

std::optional<Error> doubt_map_size(const ContourMap& map) {
  if (map.points.empty() || !map.board.empty()) return {};
  const Box box = box_of(map);
  const double extent_m = (box.high - box.low).maxCoeff();
  if (extent_m > kLargest_m)
    return Error{map.source, text("map is ", rounded(extent_m), " m wide: centimetres or millimetres?"),
                 "scale the cloud to metres and build the map again"};
  if (extent_m < kSmallest_m)
    return Error{map.source, text("map is only ", extent_m, " m wide: kilometres?"),
                 "scale the cloud to metres and build the map again"};
  return {};
}

std::optional<Error> doubt_start_place(const ContourMap& map, const Pose& T_map_body) {
  if (map.points.empty()) return {};
  const Box box = box_of(map);
  const Eigen::Vector3d p = T_map_body.p - map.anchor;
  Eigen::Vector3d outside = (box.low - p).cwiseMax(p - box.high).cwiseMax(0);
  const Eigen::Vector3d extent = box.high - box.low;
  for (int k = 0; k < 3; ++k)
    if (extent[k] < kFlatShare * extent.maxCoeff()) outside[k] = 0;  // one stands before a wall
  const double outside_m = outside.norm();
  if (outside_m < kOutside_m) return {};
  return Error{"start", text("lies ", rounded(outside_m), " m outside of the map's bounds"),
               "check --init, and that map and start share one frame and unit"};
}

std::optional<Eigen::Vector3d> up_by_accelerometer(const std::vector<ImuSample>& samples, TimeNs t) {
  const auto first = std::ranges::lower_bound(samples, t, {}, &ImuSample::t);
  ImuIncrement sum;
  for (auto a = first; a != samples.end() && a + 1 != samples.end() && sum.dt_s < kLookedAt_s; ++a)
    if ((a + 1)->t > a->t)
      sum = joined(sum, integrate(*a, *(a + 1), Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()));
  if (sum.dt_s < kLeastLookedAt_s || sum.dv.norm() < 1e-3) return {};
  return sum.dv.normalized();
}

std::optional<Error> doubt_start_attitude(const std::vector<ImuSample>& samples, const StartState& start,
                                          const std::string& where) {
  const auto up_body = up_by_accelerometer(samples, start.t);
  if (!up_body) return {};
  const Eigen::Vector3d up = start.T_map_body.q * *up_body;
  const double off_deg = kDegrees * std::acos(std::clamp(up.z(), -1.0, 1.0));
  if (off_deg < kSteepest_deg) return {};
  return Error{where,
               text("at the start the accelerometer's up lies ", std::round(off_deg), " deg off the map's z"),
               "check the quaternion of the start (x,y,z,w, of the IMU in the map), the axes of the IMU, and "
               "that the map's z is up"};
}

std::vector<Error> doubt_imu(const std::vector<ImuSample>& samples, const std::vector<TimedPose>& truth,
                             const StartState& start, const std::string& where) {
  std::vector<Error> out;
  if (auto doubt = doubt_imu_scales(samples, where)) out.push_back(*std::move(doubt));
  // The ground truth knows better than gravity alone.
  for (Error& doubt : doubt_axes_against(truth, samples, where)) out.push_back(std::move(doubt));
  if (!out.empty()) return out;
  if (auto doubt = doubt_gyro_by_gravity(samples, where)) out.push_back(*std::move(doubt));
  if (auto doubt = doubt_start_attitude(samples, start, where)) out.push_back(*std::move(doubt));
  return out;
}

}  // namespace evpose
