// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/batch/batch_estimator.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <utility>

#include "evpose/batch/following_back_end.h"
#include "evpose/fusion/calibration_states.h"
#include "evpose/tracker/map_pager.h"

namespace evpose {
namespace {

/// Beside the filter's correlation time: a mean over past and future takes off the errors that pass quickly,
/// and those that last remain. Chosen on the five shared recordings.
constexpr double kLongerCorrelation = 2;

/// Square root of the mean, over the states, of d^T P^-1 d / 6 of the pose.
double pose_change(const std::vector<ChainSmoother::Smoothed>& smoothed) {
  double sum = 0;
  for (const auto& s : smoothed) {
    const Vector6d d = s.mean.head<6>();
    sum += d.dot(s.covariance.topLeftCorner<6, 6>().ldlt().solve(d)) / 6;
  }
  return std::sqrt(sum / static_cast<double>(smoothed.size()));
}

/// A filter that moves the time offset moves the times of its updates; the passes do not.
bool estimates_time_offset(const TrackJob& job) {
  const auto& sigma = job.setup.calibration_sigma;
  return sigma && sigma->of_time_s() > 0 && job.setup.motion == MotionModel::imu &&
         job.config.tracker.fusion.calibration.on;
}

/// What a filter has found, for another one to begin with: it may be surer than it is right.
Calibration widened(Calibration found) {
  constexpr double kTimes = 3;
  found.intrinsics_sigma *= kTimes;
  found.turn_sigma_rad *= kTimes;
  found.shift_sigma_m *= kTimes;
  return found;
}

/// A filter does not look for the time offset.
CalibrationSigma sigma_of(const Calibration& known) {
  CalibrationSigma out;
  if (const Eigen::VectorXd& numbers = known.intrinsics_sigma; numbers.size() > 0) {
    out.intrinsics.emplace(numbers.begin(), numbers.begin() + 4);
    out.distortion.emplace(numbers.begin() + 4, numbers.end());
  }
  out.rotation_rad = known.turn_sigma_rad;
  out.translation_m = known.shift_sigma_m;
  out.time_s = 0;
  return out;
}

Status check_view(const TrackJob& job, const Tracker& tracker, const std::vector<Update>& updates) {
  if (updates.empty())
    return Error{job.recording.folder, "the streams end before the first update",
                 "check that events and IMU cover the start"};
  if (std::ranges::any_of(updates, [](const Update& u) { return u.points > 0; })) return {};
  return nothing_compared(job, tracker);
}

}  // namespace

/// The filter at what is known of the parameters by now; they are made if there are none.
Expected<std::unique_ptr<Tracker>> BatchEstimator::make_filter(const Eigen::MatrixXd& correlation) {
  const TrackJob job = parameters_ ? at_present_values() : job_;
  TrackerSetup setup = job.setup;
  if (parameters_) setup.calibration_sigma = sigma_of(parameters_->calibration());
  if (setup.calibration_sigma && correlation.size() > 0) setup.calibration_sigma->correlation = correlation;
  if (setup.calibration_sigma) setup.calibration_sigma->time_s = 0;
  FusionConfig resolved;
  const auto make = [&](const FusionConfig& config) {
    resolved = config;
    return make_back_end(setup.motion, config, setup.imu_noise, setup.T_body_cam);
  };
  auto tracker = Tracker::create(setup, job.config.tracker, job.start, {}, make);
  if (!tracker) return tracker.error();
  resolved.calibration.time_offset = estimates_time_offset(job_);
  if (resolved.calibration.time_offset)
    resolved.calibration.start_time_sigma_s = job_.setup.calibration_sigma->of_time_s();
  if (!parameters_) parameters_ = std::make_shared<StaticParameters>(resolved);
  return tracker;
}

Status BatchEstimator::filter(const TrackRequest& request, const Progress& progress,
                              const Eigen::MatrixXd& correlation) {
  auto tracker = make_filter(correlation);
  if (!tracker) return tracker.error();
  trajectory_ = {(*tracker)->state()};
  updates_.clear();
  (*tracker)->on_update([&](const Update& u) {
    trajectory_.push_back((*tracker)->state());
    updates_.push_back(u);
  });
  const auto go_on = [&](double share) { return !(interrupted_ = !progress(share)); };
  if (auto ok = feed_recording(at_present_values().recording, job_.config, **tracker, go_on); !ok) return ok;
  if (interrupted_) return {};
  parameters_->add(widened((*tracker)->calibration()));
  summary_ = summarise(job_, request, **tracker, (*tracker)->calibration());
  return check_view(job_, **tracker, updates_);
}

Status BatchEstimator::begin_along(std::vector<FusionState> trajectory, const Calibration& found) {
  constexpr double kTimes = 3;  // as in widened()
  const FusionState& start = trajectory.front();
  const Vector6d sigma = kTimes * start.covariance.diagonal().head<6>().cwiseSqrt();
  begin_at({start.t, start.nav.T_map_body, start.nav.velocity, start.angular_rate},
           {sigma.head<3>().maxCoeff(), sigma.tail<3>().maxCoeff()});
  const auto tracker = make_filter();
  if (!tracker) return tracker.error();
  const Matrix15d known = (*tracker)->state().covariance;
  for (FusionState& s : trajectory) s.covariance.bottomRightCorner<9, 9>() = known.bottomRightCorner<9, 9>();
  trajectory.front().covariance = known;
  trajectory.front().covariance.topLeftCorner<6, 6>() += (sigma.cwiseAbs2()).asDiagonal();
  trajectory_ = std::move(trajectory);
  updates_.clear();
  parameters_->add(widened(found));
  return {};
}

std::vector<Eigen::Vector3d> BatchEstimator::displacements() const {
  std::vector<Eigen::Vector3d> out;
  if (!parameters_->estimates_segments()) return out;
  for (const std::uint32_t segment : named_segments(*job_.map, parameters_->segment_length_m()))
    out.push_back(parameters_->displacement_of(segment));
  return out;
}

TrackJob BatchEstimator::at_present_values() const {
  const Calibration& found = parameters_->calibration();
  TrackJob out = job_;
  out.setup.T_body_cam = {found.turn * job_.setup.T_body_cam.q, job_.setup.T_body_cam.p + found.shift};
  out.setup.imu_noise.axes = parameters_->corrected(job_.setup.imu_noise.axes);
  out.recording.event_options.offset_ns += from_seconds(found.time_offset_s);
  FusionConfig& fusion = out.config.tracker.fusion;
  fusion.gravity_map = so3::exp(tilt_axes(fusion.gravity_map) * found.gravity_tilt_rad) * fusion.gravity_map;
  if (parameters_->places().intrinsics) {
    out.setup.intrinsics = corrected(*job_.setup.intrinsics, found.intrinsics);
    if (auto camera = make_camera(*out.setup.intrinsics)) out.setup.camera = *camera;
  }
  return out;
}

/// Measures along the trajectory; the tracker that has done it.
Expected<std::unique_ptr<Tracker>> BatchEstimator::follow(const Progress& progress) {
  const TrackJob job = at_present_values();
  followed_ = job.setup;
  TrackerConfig config = job.config.tracker;
  config.relocalization.on = false;
  config.fusion.start_position_sigma_m =
      std::max(config.fusion.start_position_sigma_m, of_passes_.position_m);
  config.fusion.start_rotation_sigma_rad =
      std::max(config.fusion.start_rotation_sigma_rad, of_passes_.rotation_rad);
  config.event_registration.correlation_time_s *= kLongerCorrelation;
  if (parameters_->places().imu_axes) config.fusion.imu_scale_sigma = 0;
  const auto make = [&](const FusionConfig& fusion) {
    auto back_end =
        std::make_unique<FollowingBackEnd>(StatePropagator(job.setup.motion, fusion, job.setup.imu_noise),
                                           trajectory_, job.setup.T_body_cam, *parameters_, chain_);
    back_end->on_contours(contour_callback_);
    return back_end;
  };
  auto tracker = Tracker::create(job.setup, config, job.start, {}, make);
  if (!tracker) return tracker.error();
  updates_.clear();
  (*tracker)->on_update([&](const Update& u) { updates_.push_back(u); });
  const auto go_on = [&](double share) { return !(interrupted_ = !progress(share)); };
  if (auto ok = feed_recording(job.recording, job.config, **tracker, go_on); !ok) return ok.error();
  return tracker;
}

double BatchEstimator::take(const ParameterSolution& found, double share) {
  const auto smoothed = chain_.smooth(found.z, found.covariance);
  trajectory_.resize(smoothed.size());  // another time offset may have cost the last update
  for (std::size_t k = 0; k < smoothed.size(); ++k) {
    trajectory_[k].add(share * smoothed[k].mean);
    trajectory_[k].covariance = smoothed[k].covariance;
  }
  return pose_change(smoothed);
}

Expected<ParameterInformation> BatchEstimator::measure(const Progress& progress) {
  if (const auto tracker = follow(progress); !tracker) return tracker.error();
  return chain_.parameters();
}

Expected<double> BatchEstimator::iterate(const TrackRequest& request, const Progress& progress) {
  const auto tracker = follow(progress);
  if (!tracker) return tracker.error();
  if (interrupted_) return 0;
  const ParameterSolution found = parameters_->solve(chain_.parameters());
  const double change = std::max(take(found), parameters_->change(found));
  parameters_->correct(found);
  summary_ = summarise(job_, request, **tracker, parameters_->calibration());
  return change;
}

}  // namespace evpose
