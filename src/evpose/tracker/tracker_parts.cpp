// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/tracker_parts.h"

#include <algorithm>
#include <vector>

#include "evpose/registration/contrast_memory.h"
#include "evpose/tracker/start_alignment.h"

namespace evpose {
namespace {

double distance_outside(const ContourMap& map, const Eigen::Vector3d& p) {
  Eigen::Vector3f low = map.points.front().position, high = low;
  for (const auto& q : map.points) low = low.cwiseMin(q.position), high = high.cwiseMax(q.position);
  const Eigen::Vector3d relative = p - map.anchor;
  return (low.cast<double>() - relative).cwiseMax(relative - high.cast<double>()).cwiseMax(0).norm();
}

}  // namespace

bool states_errors(const ContourMap& map) {
  const auto counts = [](const ContourPoint& point) { return !is_view_dependent(point.kind); };
  const auto states = [](const ContourPoint& point) {
    return !is_view_dependent(point.kind) && point.sigma > 0;
  };
  const auto& points = map.points;
  return 2 * std::count_if(points.begin(), points.end(), states) >
         std::count_if(points.begin(), points.end(), counts);
}

VisibleSetConfig visible_config(const TrackerConfig& config) {
  VisibleSetConfig out = config.visible;
  if (config.registration == RegistrationKind::temporal_field) out.stride_px = kFieldStride_px;
  return out;
}

std::unique_ptr<Registration> make_registration(const TrackerConfig& config, ImageSize size,
                                                const ContourMap& map, const ContourSegments& segments) {
  EventRegistrationConfig events = config.event_registration;
  events.judge_contours = config.fusion.segment_offsets == SegmentOffsetUse::on;
  const std::vector<int> contrast = contrast_of_segments(map, segments);
  const auto seeded = [&](auto registration) -> std::unique_ptr<Registration> {
    for (std::uint32_t i = 0; i < segments.count; ++i) registration->seed_contrast(i, contrast[i]);
    return registration;
  };
  if (config.registration == RegistrationKind::events)
    return seeded(std::make_unique<EventRegistration>(size, events, segments.count));
  const PolarityConfig polarity{events.polarity, events.buffer_sigma};
  return seeded(std::make_unique<TemporalFieldRegistration>(config.temporal_field, polarity, segments.count,
                                                            config.threads));
}

std::optional<FrameInput> make_frame_input(const TrackerConfig& config, const TrackerSetup& setup,
                                           const ContourSegments& segments) {
  if (config.frames.use == FrameUse::off) return {};
  return FrameInput(setup.camera->size(), setup.frame_camera, contrast_of_segments(*setup.map, segments));
}

bool follows_landmarks(const TrackerSetup& setup, const TrackerConfig& config) {
  return setup.motion == MotionModel::imu && config.fusion.kind == BackEndKind::ekf &&
         config.registration == RegistrationKind::events && states_errors(*setup.map) &&
         !setup.map->occluders.triangles.empty();
}

ContourMap with_contrast(const ContourMap& map, const ContourSegments& segments,
                         const ContrastMemory* learnt) {
  ContourMap out = map;
  for (std::size_t i = 0; learnt != nullptr && i < out.points.size(); ++i)
    if (const int sign = learnt->map_contrast(segments.of_point[i]); sign != 0)
      out.points[i].contrast = static_cast<std::int8_t>(sign);
  return out;
}

RelocalizationConfig relocalization_config(const TrackerConfig& config) {
  RelocalizationConfig out = config.relocalization;
  out.on = out.on && config.frames.use != FrameUse::alone;
  return out;
}

Status check_start(const ContourMap& map, const StartState& start, double far_m) {
  const Eigen::Vector3d& p = start.T_map_body.p;
  if (!p.allFinite() || !start.T_map_body.q.coeffs().allFinite() || !start.velocity.allFinite())
    return Error{"start pose", "not finite", "check --init"};
  const double outside_m = distance_outside(map, p);
  if (outside_m > far_m)
    return Error{"start pose",
                 text("(", p.x(), ", ", p.y(), ", ", p.z(), ") m is ", outside_m,
                      " m off the map, which is seen up to ", far_m, " m"),
                 "check that map and start pose share one frame (frames.T_map_world in recording.yaml)"};
  return {};
}

bool aligns_first_view(const TrackerConfig& config, double sigma_px) {
  constexpr double kKnownVelocity_m_s = 0.2;  // 1 sigma; from then on the updates find it
  const CalibrationConfig& c = config.fusion.calibration;
  const bool poor_start = sigma_px > StartAlignment::kNeededAbove_px &&
                          config.fusion.start_velocity_sigma_m_s > kKnownVelocity_m_s;
  return config.frames.use != FrameUse::alone && (c.intrinsics || c.rotation || c.translation || poor_start);
}

bool lens_is_guessed(const TrackerSetup& setup, const FusionConfig& fusion) {
  if (!fusion.calibration.on || !setup.calibration_sigma || setup.motion == MotionModel::imu) return false;
  return !setup.calibration_sigma->intrinsics && !setup.calibration_sigma->distortion;
}

void choose_states(const TrackerSetup& setup, FusionConfig& fusion) {
  CalibrationConfig& c = fusion.calibration;
  c.time_offset = c.rotation = c.translation = c.intrinsics = false;
  if (!c.on || !setup.calibration_sigma || fusion.kind != BackEndKind::ekf) return;
  const CalibrationSigma& sigma = *setup.calibration_sigma;
  c.start_time_sigma_s = sigma.of_time_s();
  c.start_rotation_sigma_rad = sigma.of_rotation_rad();
  c.start_translation_sigma_m = sigma.of_translation_m();
  if (setup.motion == MotionModel::imu) {
    c.time_offset = c.start_time_sigma_s > 0;
    c.rotation = (c.start_rotation_sigma_rad.array() > 0).any();
    c.translation = (c.start_translation_sigma_m.array() > 0).any();
  }
  // Held by constant velocity alone, the pose is too loose to tell the camera from nothing that was stated.
  if (!setup.intrinsics || lens_is_guessed(setup, fusion)) return;
  c.start_intrinsics_sigma = sigma.of_intrinsics(*setup.intrinsics);
  c.intrinsics = (c.start_intrinsics_sigma.array() > 0).any();
  c.start_correlation = sigma.of_correlation(*setup.intrinsics);
}

}  // namespace evpose
