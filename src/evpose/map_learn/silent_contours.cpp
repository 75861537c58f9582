// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_learn/silent_contours.h"

#include <cmath>

#include "evpose/map_learn/median.h"
#include "evpose/tracker/contour_selection.h"

namespace evpose::map_learn {
namespace {

constexpr TimeNs kLook = 20 * kNsPerMs;  // between two projections of the contours
constexpr double kSpan_s = 0.01;         // over which their motion is taken
// Chosen on one flight (room_people) with a fifth of its contours moved.
constexpr double kLeastExpected = 20;  // events, below which a segment's silence may be chance
constexpr double kSilentShare = 0.3;   // of the expected events: what else lies in the gate
constexpr double kTellsShare = 0.02;   // events a pixel from which on a segment counts as one that tells

}  // namespace

std::vector<double> swept_pixels(const TrackJob& job, const Trajectory& trajectory) {
  const ContourMap& map = *job.map;
  const ContourIndex index(map);
  const ContourSegments segments = cut_into_segments(map);
  const Camera& camera = *job.setup.camera;
  ContourSelection contours(index, segments, camera, camera, job.setup.T_body_cam, job.config.tracker.visible,
                            job.config.tracker.event_registration.map_sigma_m, false);
  std::vector<double> out(segments.count, 0);
  TimeNs next = trajectory.front().t;
  for (const FusionState& s : trajectory) {
    contours.choose(s.nav.T_map_body);
    if (s.t < next) continue;
    contours.project(s, kSpan_s);
    for (const ContourSample& sample : contours.samples())
      if (camera.size().contains(sample.pixel))
        out[sample.segment] += std::abs(sample.speed_px_s) * to_seconds(kLook);
    next += kLook;
  }
  return out;
}

std::vector<bool> silent_segments(const std::vector<double>& swept_px, const std::vector<double>& events) {
  std::vector<double> rates;
  for (std::size_t s = 0; s < swept_px.size(); ++s)
    if (swept_px[s] > 0 && events[s] > kTellsShare * swept_px[s]) rates.push_back(events[s] / swept_px[s]);
  const double usual = median(std::move(rates));
  std::vector<bool> out(swept_px.size(), false);
  for (std::size_t s = 0; s < swept_px.size(); ++s) {
    const double expected = usual * swept_px[s];
    out[s] = expected >= kLeastExpected && events[s] < kSilentShare * expected;
  }
  return out;
}

}  // namespace evpose::map_learn
