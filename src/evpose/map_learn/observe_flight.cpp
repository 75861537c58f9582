// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_learn/observe_flight.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>

#include "evpose/fusion/back_end.h"
#include "evpose/map_learn/silent_contours.h"

namespace evpose::map_learn {
namespace {

constexpr TimeNs kKnot = 100 * kNsPerMs;
constexpr TimeNs kBin = 50 * kNsPerMs;  // events of a landmark that become one observation
constexpr double kEvent_px = 0.4;       // scatter of a contour's events about it
constexpr double kLasting_px = 0.15;    // of what the events of a bin share
constexpr double kMemory_s = 0.15;      // for so long the next ones share it, too
constexpr double kLeastWeight = 4;      // events, below which a bin says nothing
constexpr double kSlow_px_s = 20;       // below this flow the edge's delay fades out (design 5.2)

/// Of one landmark over one bin.
struct Sum {
  double weight = 0, offset = 0, time_s = 0, forward = 0;
  Vector6d by_pose = Vector6d::Zero();
  Eigen::Vector3d by_point = Eigen::Vector3d::Zero(), view = Eigen::Vector3d::Zero();
};

/// In place of a fusion: the state is that of a known trajectory; what is measured is kept.
class ObservingBackEnd final : public BackEnd {
 public:
  /// From one time to another, by readings of the IMU or, without one, by constant velocity.
  struct Step {
    TimeNs from, until;
    std::optional<std::pair<ImuSample, ImuSample>> imu;
    ImuTrust trust = ImuTrust::good;
  };
  struct Log {
    std::vector<Step> steps;
    std::map<std::pair<std::uint32_t, TimeNs>, Sum> sums;  ///< by segment and bin
  };

  ObservingBackEnd(const StatePropagator& propagator, const Trajectory& trajectory, const Pose& T_body_cam,
                   double event_variance, Log& log)
      : BackEnd(propagator),
        trajectory_(trajectory),
        T_body_cam_(T_body_cam),
        event_variance_(event_variance),
        log_(log),
        state_(trajectory.front()) {}

  using BackEnd::start;
  using BackEnd::update;
  void start(const FusionState& first) override {
    state_ = state_at(trajectory_, first.t);
    state_.t = first.t;
  }
  void predict(const ImuSample& a, const ImuSample& b, ImuTrust trust) override {
    log_.steps.push_back({a.t, b.t, std::pair(a, b), trust});
    move_to(b.t);
  }
  void predict(TimeNs t) override {
    log_.steps.push_back({state_.t, t, {}});
    move_to(t);
  }
  void update(const PoseInformation&, std::span<const ContourOffset> contours) override {
    const Eigen::Matrix3d R = state_.nav.T_map_body.rotation();
    for (const ContourOffset& c : contours) {
      Sum& sum = log_.sums[{c.segment, (state_.t - trajectory_.front().t) / kBin}];
      const double w = c.weight * event_variance_;  // in events
      sum.weight += w;
      sum.offset += w * c.offset_px;
      sum.time_s += w * to_seconds(state_.t - trajectory_.front().t);
      sum.forward += w * std::clamp(c.speed_px_s / kSlow_px_s, -1.0, 1.0);
      sum.by_pose += w * c.by_pose(R);
      sum.by_point -= w * (R * c.across_body);
      sum.view += w * (R * (T_body_cam_.p - c.point_body).normalized());
    }
  }
  bool takes_contours() const override { return true; }
  const FusionState& state() const override { return state_; }

 private:
  void move_to(TimeNs t) {
    state_ = state_at(trajectory_, t);
    state_.t = t;
  }

  const Trajectory& trajectory_;
  Pose T_body_cam_;
  double event_variance_;
  Log& log_;
  FusionState state_;
};

std::vector<std::size_t> choose_knots(const Trajectory& trajectory) {
  std::vector<std::size_t> knots{0};
  for (std::size_t i = 1; i < trajectory.size(); ++i)
    if (trajectory[i].t - trajectory[knots.back()].t >= kKnot) knots.push_back(i);
  return knots;
}

/// What the IMU's readings, or constant velocity, say of each step between knots, about the trajectory.
std::vector<KnotStep> steps_between(const Trajectory& trajectory, const std::vector<std::size_t>& knots,
                                    const StatePropagator& propagator,
                                    const std::vector<ObservingBackEnd::Step>& log) {
  using error_state::kPhi;
  std::vector<KnotStep> steps;
  std::size_t next = 0;
  for (std::size_t k = 0; k + 1 < knots.size(); ++k) {
    const FusionState& there = trajectory[knots[k + 1]];
    FusionState s = trajectory[knots[k]];
    s.covariance.setZero();
    KnotStep step;
    while (next < log.size() && log[next].from < s.t) ++next;
    for (; next < log.size() && log[next].until <= there.t; ++next) {
      Matrix15d transition;
      if (const auto& imu = log[next].imu)
        propagator.propagate(s, imu->first, imu->second, log[next].trust, &transition);
      else
        propagator.propagate(s, log[next].until, &transition);
      step.transition = (transition * step.transition).eval();
    }
    // A noise of nothing at all would make a step that can never be corrected.
    constexpr double kLeast = 1e-7;
    s.covariance.diagonal().array() += kLeast * kLeast;
    const Vector15d difference = there.minus(s);
    Matrix15d turn = Matrix15d::Identity();
    turn.block<3, 3>(kPhi, kPhi) = so3::right_jacobian(difference.segment<3>(kPhi));
    step.transition = (turn * step.transition).eval();
    step.offset = turn * difference;
    step.noise = turn * s.covariance * turn.transpose();
    steps.push_back(step);
  }
  return steps;
}

/// Bins with enough events; beyond the last knot nothing is known of the trajectory.
void take_sums(const ObservingBackEnd::Log& log, const Trajectory& trajectory, FlightObservations& out) {
  const auto& knots = out.knots;
  const auto time_s = [&](std::size_t k) {
    return to_seconds(trajectory[knots[k]].t - trajectory.front().t);
  };
  for (const auto& [key, sum] : log.sums) {
    if (sum.weight < kLeastWeight) continue;
    Observation o;
    o.landmark = key.first;
    const double t = sum.time_s / sum.weight;
    std::size_t k = 0;
    while (k + 2 < knots.size() && time_s(k + 1) <= t) ++k;
    o.knot = static_cast<std::uint32_t>(k);
    o.share = std::clamp((t - time_s(k)) / (time_s(k + 1) - time_s(k)), 0.0, 1.0);
    o.by_pose = sum.by_pose / sum.weight;
    o.by_point = sum.by_point / sum.weight;
    o.offset_px = sum.offset / sum.weight;
    o.forward = sum.forward / sum.weight;
    const double own = kEvent_px * kEvent_px / sum.weight, shared = kLasting_px * kLasting_px;
    o.scatter_px2 = own + shared;
    o.variance_px2 = own + shared * 2 * kMemory_s / to_seconds(kBin);
    out.observations.push_back(o);
    out.views.push_back(sum.view.normalized());
  }
}

std::vector<bool> find_silent(const TrackJob& job, const Trajectory& trajectory,
                              const ObservingBackEnd::Log& log) {
  const std::vector<double> swept_px = swept_pixels(job, trajectory);
  std::vector<double> events(swept_px.size(), 0);
  for (const auto& [key, sum] : log.sums) events[key.first] += sum.weight;
  return silent_segments(swept_px, events);
}

}  // namespace

Expected<FlightObservations> observe_flight(const TrackJob& job, const Trajectory& trajectory,
                                            const std::function<bool(double)>& progress) {
  FlightObservations out;
  out.knots = choose_knots(trajectory);
  EVPOSE_CHECK(out.knots.size() >= 2);
  TrackerConfig config = job.config.tracker;
  config.relocalization.on = false;
  config.fusion.segment_offsets = SegmentOffsetUse::off;  // observations are named by contrast segments
  config.event_registration.correlation_time_s = 0;       // the adjustment knows what lasts
  config.event_registration.correlated_sigma_px = 0;
  const double event_sigma = config.event_registration.event_sigma_px;
  ObservingBackEnd::Log log;
  std::optional<StatePropagator> propagator;
  const auto make = [&](const FusionConfig& fusion) {
    propagator.emplace(job.setup.motion, fusion, job.setup.imu_noise);
    return std::make_unique<ObservingBackEnd>(*propagator, trajectory, job.setup.T_body_cam,
                                              event_sigma * event_sigma, log);
  };
  TrackerSetup setup = job.setup;
  setup.calibration_sigma.reset();  // the job has what was found of it
  auto tracker = Tracker::create(setup, config, job.start, {}, make);
  if (!tracker) return tracker.error();
  double matched = 0, read = 0;
  (*tracker)->on_update([&](const Update& u) { matched += u.events_matched, read += u.events_read; });
  if (auto ok = feed_recording(job.recording, job.config, **tracker, progress); !ok) return ok.error();
  out.explained = matched / std::max(1.0, read);
  out.steps = steps_between(trajectory, out.knots, *propagator, log.steps);
  take_sums(log, trajectory, out);
  out.silent = find_silent(job, trajectory, log);
  out.map = (*tracker)->map_with_learnt_contrast();
  return out;
}

}  // namespace evpose::map_learn
