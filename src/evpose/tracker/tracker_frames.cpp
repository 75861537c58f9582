// SPDX-License-Identifier: BSD-3-Clause
// Tracker: what frames add to the events.
#include "evpose/tracker/tracker.h"

namespace evpose {
namespace {

// Below such a sigma of the pose, in the image, frames are left out.
constexpr double kSureByEvents_px = 0.14;

}  // namespace

void Tracker::add_frame(Frame frame) {
  EVPOSE_CHECK(frame.size == setup_.camera->size());
  if (frames_) frames_->add(std::move(frame));
}

/// With a frame that has been exposed since the last update, if there is one and it is believed. Where no
/// events were used, `measured` becomes what it says.
bool Tracker::fuse_frame(TimeNs t, bool aligning, RegistrationResult& measured) {
  if (!frames_) return false;
  if (needs_no_frame()) frames_->pass_over(t);
  const auto found = aligning || supervisor_.searching() ? std::nullopt : frames_->measure(t, frame_view());
  const bool used =
      found &&
      frames_->refusal(*found, fusion_->measured_covariance(), config_.health.innovation_gate).empty();
  if (used) fuse(*found, frames_->offsets());
  if (used && measured.inliers == 0) measured = *found;
  frames_->remember(t, fusion_->state());
  return used;
}

/// Where events hold the pose, a frame adds little but its own lasting errors.
bool Tracker::needs_no_frame() const {
  const PoseUncertainty uncertainty(fusion_->state(), typical_view());
  return config_.frames.use == FrameUse::fused && supervisor_.initialised() &&
         uncertainty.separate_px() < kSureByEvents_px;
}

/// What a frame is measured with: the contours, and the state since they were projected.
FrameInput::Seen Tracker::frame_view() const {
  const NavState& now = fusion_->state().nav;
  return {contours_.samples(),
          fusion_->measured_covariance(),
          {now.T_map_body.minus(projected_.T_map_body), now.velocity - projected_.velocity},
          fusion_->state()};
}

}  // namespace evpose
