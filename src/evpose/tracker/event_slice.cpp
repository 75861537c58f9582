// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/event_slice.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>

namespace evpose {
namespace {

// Faint edges need a pixel's motion to show at all: so many events per column of the image make it likely.
constexpr double kEventsPerColumn = 30;
constexpr double kThinShare = 0.25;     // of them is enough after kThinAfter_s
constexpr double kThinAfter_s = 0.015;  // slow motion: contours move little in this time
constexpr double kLongest_s = 0.03;     // contours at 1 m/s and 3 m move by some pixels
constexpr double kManyTimes = 3;        // as many events show faint edges, too
constexpr std::size_t kFewestEvents = 500;
constexpr int kFlowCell_px = 16;  // rotational flow is taken as constant within

}  // namespace

void EventSlice::restart(TimeNs t) {
  events_.clear();
  begin_ = t;
}

/// 1: as many events as a slice needs.
double EventSlice::filled() const {
  return static_cast<double>(events_.size()) / (kEventsPerColumn * image_width_);
}

bool EventSlice::complete(TimeNs t) const {
  const double span_s = to_seconds(t - begin_);
  return filled() >= 1 || (filled() >= kThinShare && span_s >= kThinAfter_s) || span_s >= kLongest_s;
}

bool EventSlice::complete_with_faint_edges(TimeNs t) const {
  return filled() >= kManyTimes || to_seconds(t - begin_) >= kLongest_s;
}

bool EventSlice::sparse() const { return events_.size() < kFewestEvents; }

double EventSlice::mean_age_s(std::uint32_t now_us) const {
  double sum_s = 0;
  for (const FilteredEvent& e : events_) sum_s += 1e-6 * (now_us - e.stamp_us);
  return sum_s / static_cast<double>(std::max<std::size_t>(1, events_.size()));
}

void compensate_rotation(std::span<const FilteredEvent> events, const Camera& camera,
                         const SliceRotation& rotation, std::vector<FilteredEvent>& out) {
  const ImageSize size = camera.size();
  const int columns = size.width / kFlowCell_px + 1, rows = size.height / kFlowCell_px + 1;
  std::vector<Eigen::Vector2d> flow(static_cast<std::size_t>(columns * rows), Eigen::Vector2d::Zero());
  for (int row = 0; row < rows; ++row)
    for (int column = 0; column < columns; ++column) {
      const auto ray = camera.unproject({(column + 0.5) * kFlowCell_px, (row + 0.5) * kFlowCell_px});
      Matrix23d J;
      if (ray && camera.project(*ray, &J))
        flow[static_cast<std::size_t>(row * columns + column)] = -J * rotation.rate_cam.cross(*ray);
    }
  out.clear();
  for (FilteredEvent e : events) {
    // By so much the instant is after the event.
    const double later_s = 1e-6 * (rotation.now_us - e.stamp_us) - rotation.age_s;
    const Eigen::Vector2d& f =
        flow[static_cast<std::size_t>(e.y / kFlowCell_px * columns + e.x / kFlowCell_px)];
    const double x = std::round(e.x + f.x() * later_s), y = std::round(e.y + f.y() * later_s);
    if (!(x >= 0 && y >= 0 && x < size.width && y < size.height)) continue;
    e.x = static_cast<std::uint16_t>(x);
    e.y = static_cast<std::uint16_t>(y) & 0x7FFF;
    out.push_back(e);
  }
}

}  // namespace evpose
