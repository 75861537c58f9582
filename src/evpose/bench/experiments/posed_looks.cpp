// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/bench/experiments/posed_looks.h"

#include <algorithm>

namespace evpose::experiments {
namespace {

TrackerConfig with_sensor(TrackerConfig config, const TrackerSetup& setup) {
  config.event_registration.trail_filter = setup.trail_filter;
  return config;
}

/// Holds the events against the contours as seen from given poses, one update after the other.
class PosedRegistration {
 public:
  PosedRegistration(const TrackJob& job, const std::vector<TimedPose>& poses)
      : job_(job),
        config_(with_sensor(job.config.tracker, job.setup)),
        poses_(poses),
        index_(*job.map),
        segments_(cut_into_segments(*job.map)),
        contours_(index_, segments_, *job.setup.camera, *job.setup.camera, job.setup.T_body_cam,
                  config_.visible, config_.event_registration.map_sigma_m, false),
        preprocessor_(job.setup.camera->size().width, job.setup.camera->size().height, config_.events),
        registration_(job.setup.camera->size(), config_.event_registration, segments_.count),
        counter_(job.setup.camera->size(), *job.map) {}

  std::vector<ContourLook> run(const std::vector<EventPacket>& packets) {
    constexpr TimeNs kBorder = 6 * kNsPerMs;  // the velocity at a time needs poses around it
    const TimeNs period = from_seconds(1 / config_.rate_hz);
    const TimeNs begin = std::max(job_.start.t, poses_.front().t + kBorder), end = poses_.back().t - kBorder;
    InputQueue input(preprocessor_, {});
    TimeNs next = begin;
    for (const EventPacket& packet : packets) {
      input.offer(packet);
      for (; next < end && input.feed_until(next); next += period) update(next, next > begin ? period : 0);
      input.keep_rest();
    }
    return counter_.looks();
  }

 private:
  void update(TimeNs t, TimeNs span) {
    const StartState at = start_at(poses_, t);
    FusionState state;
    state.t = t;
    state.nav = {at.T_map_body, at.velocity};
    state.angular_rate = at.angular_rate_body;
    contours_.choose(state.nav.T_map_body);
    contours_.project(state, to_seconds(span));
    const RegistrationProblem problem{preprocessor_.kept(), preprocessor_.stamp(t), to_seconds(span),
                                      contours_.samples(), no_covariance_};
    if (span > 0) {
      registration_.measure(problem);
      counter_.add(problem, to_seconds(t - job_.start.t), registration_);
    }
    preprocessor_.set_motion(contours_.typical_flow_px_s());
    preprocessor_.clear_kept();
  }

  const TrackJob& job_;
  const TrackerConfig config_;
  const std::vector<TimedPose>& poses_;
  ContourIndex index_;
  ContourSegments segments_;
  ContourSelection contours_;
  EventPreprocessor preprocessor_;
  EventRegistration registration_;
  LookCounter counter_;
  const Matrix6d no_covariance_ = Matrix6d::Zero();
};

}  // namespace

Expected<std::vector<TimedPose>> tracked_poses(const Streams& streams) {
  auto tracker = Tracker::create(streams.job.setup, streams.job.config.tracker, streams.job.start);
  if (!tracker) return tracker.error();
  std::vector<TimedPose> out;
  const auto add = [&](TimeNs t, const Pose& pose) {
    if (out.empty() || t > out.back().t) out.push_back({t, pose});
  };
  (*tracker)->on_update([&](const Update& u) { add(u.t, u.T_map_body); });
  (*tracker)->on_state([&](const FusionState& s) { add(s.t, s.nav.T_map_body); });
  feed(streams.packets, streams.imu, **tracker);
  return out;
}

std::vector<ContourLook> looks_from(const Streams& streams, const std::vector<TimedPose>& poses) {
  return PosedRegistration(streams.job, poses).run(streams.packets);
}

}  // namespace evpose::experiments
