// SPDX-License-Identifier: BSD-3-Clause
// Tracker: what edges beside the map's contours tell of the motion.
#include "evpose/tracker/tracker.h"

namespace evpose {

/// Once a pose is out: what is to be collected for the next.
void Tracker::prepare_landmarks(bool measures) {
  if (!landmarks_) return;
  if (measures)
    landmarks_->prepare(next_update_, preprocessor_);
  else
    preprocessor_.collect(nullptr);
}

/// Before the events of the next update come.
void Tracker::expect_landmarks(const FusionState& coming, double span_s) {
  const auto found_at = fusion_->kept_pose();
  if (landmarks_ && found_at) landmarks_->expect(coming, span_s, *found_at);
}

void Tracker::follow_landmarks(TimeNs t, double span_s, bool measured) {
  if (!landmarks_) return;
  if (!measured) return landmarks_->restart();
  landmarks_->update(
      {t, preprocessor_.stamp(t), span_s, forecast_ ? &*forecast_ : nullptr, contours_.typical_flow_px_s()},
      *fusion_);
  take_calibration();
}

}  // namespace evpose
