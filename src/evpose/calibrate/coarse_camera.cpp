// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/calibrate/coarse_camera.h"

#include <algorithm>
#include <cmath>

#include "evpose/calibrate/event_slices.h"
#include "evpose/camera/adjusted_camera.h"
#include "evpose/map/visible_set.h"
#include "evpose/registration/pose_search.h"

namespace evpose {
namespace {

constexpr double kBridged_px = 4;  // that the alignment of the start bridges: its first gate
constexpr double kReach = 2;       // sigmas to each side
constexpr double kStep_px = 8;     // of the coarse grid, at the image's rim: the reach of a coarse edge
constexpr double kFineStep_px = 2;
constexpr int kFineSteps = 2;  // of each number, to each side
constexpr double kStrideOfPoints_px = 8;
constexpr int kPoints = 700;

/// What a grid of cameras is made of: a change of each number by one step.
struct Steps {
  Eigen::VectorXd focal, cx, cy, radial;        ///< of all numbers
  int focal_count, centre_count, radial_count;  ///< to each side
};

Steps steps_of(const CameraIntrinsics& camera, const Eigen::VectorXd& sigma, double step_px, int most) {
  const Eigen::Index n = sigma.size();
  const double rim_px = 0.5 * camera.size.width, rim = rim_px / camera.fx;
  Steps out{Eigen::VectorXd::Zero(n),
            Eigen::VectorXd::Zero(n),
            Eigen::VectorXd::Zero(n),
            Eigen::VectorXd::Zero(n),
            0,
            0,
            0};
  out.focal(0) = step_px / rim_px * camera.fx;
  out.focal(1) = step_px / rim_px * camera.fy;
  out.cx(2) = out.cy(3) = step_px;
  const auto count = [&](double reach, double step) {
    return std::min(most, static_cast<int>(std::ceil(kReach * reach / step)));
  };
  out.focal_count = count(sigma(0), out.focal(0));
  out.centre_count = count(sigma(2), step_px);
  // Double sphere has a shape of its own: it is left to the alignment.
  if (n > 4 && camera.distortion_model != "ds") {
    out.radial(4) = step_px / (rim * rim * rim * camera.fx);
    out.radial_count = count(sigma(4), out.radial(4));
  }
  return out;
}

class Trials {
 public:
  Trials(const TrackJob& job, const EdgeField& field, const Pose& T_map_body)
      : camera_(*job.setup.intrinsics), field_(field), T_map_cam_(T_map_body * job.setup.T_body_cam) {
    VisibleSetConfig config = job.config.tracker.visible;
    config.stride_px = kStrideOfPoints_px;
    config.budget = kPoints;
    config.margin_px = kReach * kStep_px * 2;
    const ContourIndex index(*job.map);
    VisibleSet visible(index, *job.setup.camera, config);
    for (const std::uint32_t i : visible.choose(T_map_cam_))
      points_.push_back({job.map->position(i), job.map->points[i].tangent.cast<double>()});
  }

  /// The best of the grid about `middle`.
  Eigen::VectorXd best(const Eigen::VectorXd& middle, const Steps& steps, EdgeSpread spread) const {
    Eigen::VectorXd out = middle;
    double most = score(middle, spread);
    for (int f = -steps.focal_count; f <= steps.focal_count; ++f)
      for (int k = -steps.radial_count; k <= steps.radial_count; ++k)
        for (int x = -steps.centre_count; x <= steps.centre_count; ++x)
          for (int y = -steps.centre_count; y <= steps.centre_count; ++y) {
            const Eigen::VectorXd numbers =
                middle + f * steps.focal + k * steps.radial + x * steps.cx + y * steps.cy;
            const double here = score(numbers, spread);
            if (here > most) most = here, out = numbers;
          }
    return out;
  }

 private:
  double score(const Eigen::VectorXd& numbers, EdgeSpread spread) const {
    const auto camera = make_camera(corrected(camera_, numbers));
    constexpr double kNone = -1e9;
    if (!camera) return kNone;
    return score_pose({field_, **camera, identity_, points_}, T_map_cam_, spread);
  }

  const CameraIntrinsics& camera_;
  const EdgeField& field_;
  Pose T_map_cam_;
  const Pose identity_;
  std::vector<SearchPoint> points_;
};

/// Where the body is a while after the start.
Pose pose_at(const StartState& start, TimeNs t) {
  const double dt_s = to_seconds(t - start.t);
  return {(start.T_map_body.q * so3::exp(dt_s * start.angular_rate_body)).normalized(),
          start.T_map_body.p + dt_s * start.velocity};
}

/// By how many pixels the given numbers may be off at the rim.
double uncertain_px(const CameraIntrinsics& camera, const Eigen::VectorXd& sigma) {
  return std::max(sigma(0) / camera.fx * 0.5 * camera.size.width, sigma(2));
}

}  // namespace

Expected<Calibration> coarse_camera(const TrackJob& job) {
  const CameraIntrinsics& camera = *job.setup.intrinsics;
  const CalibrationSigma& given = *job.setup.calibration_sigma;
  Calibration out;
  const Eigen::VectorXd sigma = given.of_intrinsics(camera);
  out.intrinsics.setZero(sigma.size());
  out.intrinsics_sigma = sigma;
  out.turn_sigma_rad = given.of_rotation_rad();
  out.shift_sigma_m = given.of_translation_m();
  if (uncertain_px(camera, sigma) < kBridged_px) return out;
  auto reader = open_events(job.recording);
  if (!reader) return reader.error();
  EventSlices slices(**reader, camera.size);
  const auto more = slices.next(job.start.t);
  if (!more) return more.error();
  if (!*more) return out;
  EdgeField field(camera.size);
  field.build(slices.events());
  const Trials trials(job, field, pose_at(job.start, slices.middle()));
  constexpr int kUnbounded = 100;
  const Steps coarse = steps_of(camera, sigma, kStep_px, kUnbounded),
              fine = steps_of(camera, sigma, kFineStep_px, kFineSteps);
  const Eigen::VectorXd near = trials.best(out.intrinsics, coarse, EdgeSpread::coarse);
  out.intrinsics = trials.best(near, fine, EdgeSpread::fine);
  // To about the last step; tangential terms and higher radial ones are as they were.
  const Steps& last = fine;
  const Eigen::VectorXd grid = (last.focal + last.cx + last.cy + last.radial).cwiseAbs();
  for (Eigen::Index i = 0; i < grid.size(); ++i)
    if (grid(i) > 0) out.intrinsics_sigma(i) = std::min(sigma(i), 2 * grid(i));
  return out;
}

}  // namespace evpose
