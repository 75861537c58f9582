// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/bench/experiments/unseen/tracked_run.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <utility>

#include "evpose/bench/experiments/streams.h"
#include "evpose/eval/score.h"
#include "evpose/eval/statistics.h"
#include "evpose/report/overlay.h"
#include "evpose/report/series.h"

namespace evpose::experiments::unseen {
namespace {

constexpr std::size_t kCoursePoints = 400;               // of the picture of a run
constexpr TimeNs kLookEvery = 250 * kNsPerMs;            // for the moment that is drawn
constexpr double kShown = 0.15;                          // events in that picture per pixel, about
constexpr double kShortest_s = 1e-3, kLongest_s = 0.02;  // in which they came

bool is_far(const ErrorSample& sample, const Matrix6d& covariance) {
  const Eigen::LLT<Matrix6d> factor(covariance);
  if (factor.info() != Eigen::Success) return true;
  const Vector6d d = sample.truth.minus(sample.estimate);
  return !(factor.matrixL().solve(d).squaredNorm() <= kFarSquared);
}

ErrorCourse course_of(const std::vector<ErrorSample>& samples, const std::vector<TrackedPose>& poses,
                      TimeNs start) {
  ErrorCourse out;
  for (const std::size_t i : evenly_spaced_indices(samples.size(), kCoursePoints)) {
    const ErrorSample& s = samples[i];
    out.t_s.push_back(rounded(to_seconds(s.t - start), 6));
    out.position_mm.push_back(rounded(s.ate_mm(), 4));
    out.rotation_deg.push_back(rounded(s.are_deg(), 4));
    out.sigma_mm.push_back(rounded(1e3 * s.sigma.head<3>().norm(), 4));
    out.tracking.push_back(poses[s.index].health == Health::tracking);
  }
  return out;
}

/// Keeps the picture of the largest error among moments at equal distances.
class WorstMoment {
 public:
  WorstMoment(const std::vector<TimedPose>& truth, TimeNs from, double decay_s)
      : truth_(truth), next_(from), decay_s_(decay_s) {}

  void look(const Tracker& tracker, const Update& u) {
    if (u.t < next_ || u.t >= truth_.back().t) return;
    next_ += kLookEvery;
    const double error_m = (u.T_map_body.p - start_at(truth_, u.t).T_map_body.p).norm();
    if (snapshot_ && !(error_m > error_m_)) return;
    error_m_ = error_m;
    snapshot_ = tracker.snapshot(decay_s_);
  }

  std::optional<RgbImage> picture() const {
    if (!snapshot_) return std::nullopt;
    std::vector<OverlayPoint> points;
    for (const auto& p : snapshot_->points) points.push_back({p.x, p.y, p.matched});
    return draw_overlay(snapshot_->size.width, snapshot_->size.height, snapshot_->decay, points);
  }

 private:
  const std::vector<TimedPose>& truth_;
  TimeNs next_;
  double decay_s_, error_m_ = 0;
  std::optional<Snapshot> snapshot_;
};

bool has_built_map(Given given) { return given == Given::built_map || given == Given::both; }

TrackRequest request_of(const Flight& flight, Given given) {
  TrackRequest request;
  request.recording = flight.folder;
  request.init = "groundtruth";
  request.map = has_built_map(given) ? flight.map_path() : flight.contours_path();
  if (!has_built_map(given)) request.occluders = flight.mesh_path();
  if (given == Given::truth || given == Given::built_map)
    request.calibration = flight.true_calibration_path();
  return request;
}

TrackedRun without_figures(const std::string& fault) {
  TrackedRun out;
  out.judgement.figures.fault = fault;
  return out;
}

}  // namespace

Judgement judge(const std::vector<TrackedPose>& poses, const std::vector<TimedPose>& truth, TimeNs from) {
  Judgement judged;
  RunFigures& out = judged.figures;
  std::vector<TrackedPose> stood_by;
  std::vector<TimedPose> estimate;
  std::vector<Matrix6d> covariances;
  int tracking = 0;
  for (const TrackedPose& p : poses) {
    if (p.pose.t < from) continue;
    ++out.poses;
    tracking += p.health == Health::tracking ? 1 : 0;
    if (!has_pose(p.health)) continue;
    stood_by.push_back(p);
    estimate.push_back(p.pose);
    covariances.push_back(p.covariance);
  }
  out.tracking = static_cast<double>(tracking) / std::max(1, out.poses);
  const TrajectoryScore score = score_trajectory({estimate, truth, covariances, {}, {}}, {});
  const double nees6 = score.nees6_mean.value_or(NAN);
  if (score.pairs < 2 || !std::isfinite(score.ate_mm.mean + score.are_deg.mean + nees6)) {
    out.fault = score.pairs < 2 ? "lost" : "not finite";
    return judged;
  }
  out.ate_mm = score.ate_mm.mean;
  out.ate_max_mm = score.ate_mm.max;
  out.are_deg = score.are_deg.mean;
  out.nees6 = nees6;
  if (const auto& d = score.nees_by_direction)
    out.nees_by_direction = {d->position.x(), d->position.y(), d->position.z(),     d->rotation.x(),
                             d->rotation.y(), d->rotation.z(), d->weakest_position, d->weakest_rotation};
  std::vector<double> tracking_mm;
  for (const ErrorSample& s : score.samples) {
    if (stood_by[s.index].health != Health::tracking) continue;
    tracking_mm.push_back(s.ate_mm());
    out.silent += is_far(s, stood_by[s.index].covariance) ? 1 : 0;
  }
  out.ate_tracking_mm = evpose::summarise(std::move(tracking_mm)).mean;
  out.at_end = to_string(poses.back().health);
  judged.course = course_of(score.samples, stood_by, truth.front().t);
  return judged;
}

Expected<TrackedRun> track_flight(const Flight& flight, Given given, const RunConfig& config) {
  if (has_built_map(given) && !flight.map_fault.empty()) return without_figures(flight.map_fault);
  const auto job = prepare(request_of(flight, given), config);
  if (!job) return job.error();
  const auto tracker = Tracker::create(job->setup, job->config.tracker, job->start);
  if (!tracker) return without_figures(tracker.error().what);
  const TimeNs judged = job->start.t + from_seconds(kJudgedAfter_s);
  const ImageSize size = job->setup.camera->size();
  const double decay_s = kShown * size.width * size.height / (1e6 * std::max(flight.mev_s, 1e-6));
  WorstMoment moment(job->truth, judged, std::clamp(decay_s, kShortest_s, kLongest_s));
  std::vector<TrackedPose> poses;
  (*tracker)->keep_time_surface(true);
  (*tracker)->on_update([&](const Update& u) {
    poses.push_back({{u.t, u.T_map_body}, u.covariance, u.health});
    moment.look(**tracker, u);
  });
  if (Status done = feed_recording(job->recording, job->config, **tracker, {}); !done) return done.error();
  return TrackedRun{judge(poses, job->truth, judged), moment.picture()};
}

}  // namespace evpose::experiments::unseen
