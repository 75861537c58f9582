// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/frame_input.h"

#include <cmath>

#include "evpose/core/config.h"
#include "evpose/registration/frame_registration.h"
#include "evpose/tracker/health.h"

namespace evpose {
namespace {

constexpr double kTooOld_s = 0.15;  // the motion since then is not known well enough
constexpr double kFirstInterval_s = 0.033;
constexpr TimeNs kFresh = 200 * kNsPerMs;  // a frame that tells where the contours are now
constexpr double kDoubtMemory_s = 1;       // of a contradiction between frames and the pose
constexpr double kDoubtRises_s = 0.1;
constexpr double kUsualDoubt = 1;  // beyond it, events lose information by the square

}  // namespace

void describe(ConfigTable& table, FrameUseConfig& c) {
  table.add("use", c.use, {{"fused", FrameUse::fused}, {"off", FrameUse::off}, {"alone", FrameUse::alone}},
            "pictures of a recording that has them: beside the events, not at all, or without the events");
}

FrameInput::FrameInput(ImageSize size, const FrameCamera& camera, std::span<const int> map_contrast)
    : camera_(camera), registration_(std::make_unique<FrameRegistration>(size, camera, map_contrast)) {}
FrameInput::FrameInput(FrameInput&&) noexcept = default;
FrameInput& FrameInput::operator=(FrameInput&&) noexcept = default;
FrameInput::~FrameInput() = default;

std::span<const SampleOffset> FrameInput::offsets() const { return registration_->offsets(); }

int FrameInput::contrast(std::uint32_t segment) const { return last_ ? registration_->contrast(segment) : 0; }

void FrameInput::rearrange_segments(std::span<const std::uint32_t> before,
                                    std::span<const int> map_contrast) {
  registration_->rearrange_segments(before, map_contrast);
}

void FrameInput::restart() {
  waiting_.clear();
  motions_.clear();
  agreed_ = 0;
  doubt_ = 0;
}

void FrameInput::remember(TimeNs t, const FusionState& state) {
  motions_.push_back({t, state.nav.velocity, state.angular_rate});
  while (to_seconds(t - motions_.front().t) > kTooOld_s) motions_.pop_front();
}

Vector6d FrameInput::beside_constant_velocity(TimeNs t, TimeNs then, const FusionState& state) const {
  const Pose& now = state.nav.T_map_body;
  const double age_s = to_seconds(t - then);
  const Pose constant{now.q * so3::exp(-age_s * state.angular_rate), now.p - age_s * state.nav.velocity};
  Pose pose = now;
  Motion later{t, state.nav.velocity, state.angular_rate};
  for (auto it = motions_.rbegin(); it != motions_.rend() && later.t > then; ++it) {
    if (it->t >= later.t) continue;
    const double whole_s = to_seconds(later.t - it->t);
    const double part_s = std::min(whole_s, to_seconds(later.t - then)), half = 0.5 * part_s / whole_s;
    // Both change evenly: over the part their mean is that in its middle.
    const Eigen::Vector3d rate = later.angular_rate + half * (it->angular_rate - later.angular_rate);
    const Eigen::Vector3d velocity = later.velocity + half * (it->velocity - later.velocity);
    pose = {pose.q * so3::exp(-part_s * rate), pose.p - part_s * velocity};
    later = *it;
  }
  if (later.t > then) {
    const double rest_s = to_seconds(later.t - then);
    pose = {pose.q * so3::exp(-rest_s * later.angular_rate), pose.p - rest_s * later.velocity};
  }
  return pose.minus(constant);
}

/// That is exposed by t; those before it are forgotten.
std::optional<Frame> FrameInput::take_newest(TimeNs t) {
  std::optional<Frame> frame;
  for (; !waiting_.empty() && waiting_.front().end(camera_) <= t; waiting_.pop_front())
    frame = std::move(waiting_.front());
  return frame;
}

std::optional<RegistrationResult> FrameInput::measure(TimeNs t, const Seen& seen) {
  const std::optional<Frame> frame = take_newest(t);
  if (!frame || to_seconds(t - frame->t) > kTooOld_s) return {};
  const double since_last_s = last_ ? to_seconds(frame->t - *last_) : kFirstInterval_s;
  last_ = frame->t;
  ForecastError error = seen.forecast;
  error.pose += beside_constant_velocity(t, frame->t, seen.state);
  RegistrationResult result = registration_->measure(
      {*frame, to_seconds(t - frame->t), since_last_s, seen.samples, seen.pose_covariance, error});
  agreed_ = registration_->agrees() ? agreed_ + 1 : 0;
  // What frames share, the estimate knows only once: held against it, they count in full.
  const double repeats = FrameRegistration::repeats(since_last_s);
  const double contradiction =
      innovation(seen.pose_covariance, {repeats * result.information, repeats * result.vector});
  const double memory_s = contradiction > doubt_ ? kDoubtRises_s : kDoubtMemory_s;
  doubt_ += (1 - std::exp(-since_last_s / memory_s)) * (contradiction - doubt_);
  return result;
}

bool FrameInput::confirms(TimeNs t) const { return agreed_ >= kConfirming && last_ && t - *last_ < kFresh; }

double FrameInput::share_of_events() const {
  const double excess = doubt_ / kUsualDoubt;
  return excess > 1 ? 1 / (excess * excess) : 1;
}

std::string FrameInput::refusal(const RegistrationResult& result, const Matrix6d& pose_covariance,
                                double innovation_gate) {
  if (result.inliers < kLeastInliers)
    return text("only ", result.inliers, " of ", result.points, " map points have an edge in the frame");
  if (!(innovation(pose_covariance, {result.information, result.vector}) <= innovation_gate))
    return "the frame contradicts the prediction";
  return "";
}

}  // namespace evpose
