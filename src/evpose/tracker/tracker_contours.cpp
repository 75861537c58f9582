// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/contrast_memory.h"
#include "evpose/tracker/tracker.h"

namespace evpose {
namespace {

// Contours that the prediction has moved by less since the forecast are moved along, others projected anew.
constexpr double kForecastHolds_px = 0.25;

}  // namespace

/// Another part of the map, if the camera has gone so far, between two choices of points.
void Tracker::page_map() {
  const bool may_take = !contours_.choosing() && !supervisor_.searching() && !start_alignment_;
  const auto next = pager_.next(fusion_->state().nav.T_map_body.p, map_, may_take);
  if (!next) return;
  if (landmarks_) landmarks_->let_go_of_map();
  setup_.map = next->prepared.map;
  map_ = std::move(next->prepared);
  contours_.renumber(next->point_now);
  registration_->rearrange_segments(next->segment_before, next->contrast);
  if (frames_) frames_->rearrange_segments(next->segment_before, next->contrast);
  supervisor_.rearrange(next->segment_before, told_by_flights(*map_.map, map_.segments));
}

/// The contours as the prediction has them, unless they are as the forecast had them but for a small change.
void Tracker::see_contours(double span_s) {
  const FusionState& state = fusion_->state();
  if (forecast_ &&
      contours_.largest_shift_px(state.nav.T_map_body.minus(forecast_->T_map_body)) < kForecastHolds_px)
    return;
  forecast_.reset();
  project_samples(state, span_s);
}

/// Where the map has them, or where their segments are known to stand.
void Tracker::project_samples(const FusionState& state, double span_s) {
  contours_.project(state, span_s);
  projected_ = state.nav;
  if (!map_.offset_segments.empty())
    contours_.displace(
        [this](std::uint32_t point) { return fusion_->displacement_of(map_.offset_segments[point]); });
}

/// +1: it is darker where the map's normal points, -1: brighter, 0: not known.
int Tracker::darker_side(std::uint32_t segment) const {
  const ContrastMemory* contrast = registration_->contrast();
  const int by_events = contrast == nullptr ? 0 : contrast->map_contrast(segment);
  return -(by_events == 0 && frames_ ? frames_->contrast(segment) : by_events);
}

ContourOffset Tracker::contour_offset(const SampleOffset& offset, double concentration) const {
  const Pose& predicted = fusion_->state().nav.T_map_body;
  const ContourSample& s = contours_.samples()[offset.sample];
  ContourOffset out{predicted.inverse() * map_.map->position(s.point),
                    predicted.q.conjugate() * Eigen::Vector3d(s.jacobian.head<3>()),
                    offset.offset_px,
                    offset.weight,
                    map_.offset_segments.empty() ? s.segment : map_.offset_segments[s.point],
                    map_.map->points[s.point].sigma,
                    s.normal_px,
                    s.speed_px_s,
                    s.normal_side * darker_side(s.segment),
                    concentration};
  if (!adjusted_) return out;
  const auto by_numbers = adjusted_->by_numbers(T_body_cam_.inverse() * out.point_body);
  if (by_numbers) out.by_intrinsics = -s.normal_px.transpose() * *by_numbers;
  return out;
}

}  // namespace evpose
