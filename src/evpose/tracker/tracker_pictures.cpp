// SPDX-License-Identifier: BSD-3-Clause
// What a tracker shows of itself.
#include "evpose/tracker/tracker.h"
#include "evpose/tracker/tracker_parts.h"

namespace evpose {

ContourMap Tracker::map_with_learnt_contrast() const {
  return with_contrast(*map_.map, map_.segments, registration_->contrast());
}

Snapshot Tracker::snapshot(double decay_s) const {
  Snapshot out;
  out.size = setup_.camera->size();
  const auto pixels = static_cast<std::size_t>(out.size.width) * static_cast<std::size_t>(out.size.height);
  out.decay = preprocessor_.surface() != nullptr
                  ? decayed(*preprocessor_.surface(), preprocessor_.stamp(fusion_->state().t), decay_s)
                  : std::vector<float>(pixels);
  out.points = chosen_points(decay_s);
  return out;
}

std::vector<Snapshot::Point> Tracker::chosen_points(double decay_s) const {
  const FusionState& state = fusion_->state();
  return project_points(contours_.view(), contours_.points(), state.nav.T_map_body, preprocessor_.surface(),
                        preprocessor_.stamp(state.t), decay_s);
}

}  // namespace evpose
