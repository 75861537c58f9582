// SPDX-License-Identifier: BSD-3-Clause
// A flight past boxes of glass, whose edges make exact events, for tests.
#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <random>
#include <span>
#include <utility>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/event/event.h"
#include "evpose/event/event_preprocessor.h"
#include "evpose/imu/imu.h"
#include "evpose/imu/strapdown.h"
#include "evpose/map/contour_map.h"

namespace evpose::test_flight {

inline constexpr TimeNs kStart_ns = kNsPerMs;
inline constexpr double kImuPeriod_s = 1e-3;

/// Pose of the body at a time of the flight: smooth, with enough of each of its six components.
inline Pose pose_at(double t_s) {
  return {so3::exp(Eigen::Vector3d(0.06 * std::sin(1.7 * t_s), 0.10 * std::sin(2.1 * t_s + 0.5),
                                   0.08 * std::sin(1.3 * t_s))),
          {0.8 + 0.20 * std::sin(1.9 * t_s), 3 + 0.25 * std::sin(1.5 * t_s + 0.4),
           1.5 + 0.12 * std::sin(2.3 * t_s)}};
}

inline Eigen::Vector3d velocity_at(double t_s) {
  constexpr double h = 1e-4;
  return (pose_at(t_s + h).p - pose_at(t_s - h).p) / (2 * h);
}

inline ImuSample imu_at(double t_s) {
  constexpr double h = 1e-4;
  const Pose a = pose_at(t_s - h), b = pose_at(t_s), c = pose_at(t_s + h);
  const Eigen::Vector3d acceleration = (a.p - 2 * b.p + c.p) / (h * h);
  return {kStart_ns + from_seconds(t_s), so3::log(a.q.conjugate() * c.q) / (2 * h),
          b.q.conjugate() * (acceleration + Eigen::Vector3d(0, 0, 9.81))};
}

/// Camera axes in the body's: z along the body's x.
inline Pose camera_on_body() {
  Eigen::Matrix3d R;
  R << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  return {Eigen::Quaterniond(R), {0.03, 0.01, -0.02}};
}

inline std::shared_ptr<const Camera> make_flight_camera() {
  return std::move(make_camera({300, 300, 159.5, 119.5, "radtan", {-0.05, 0.01, 0, 0}, {320, 240}})).value();
}

/// Appends a contour from a to b, with points every 2 cm.
inline void add_edge(ContourMap& map, const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  constexpr double kSpacing_m = 0.02;
  const Eigen::Vector3d t = (b - a).normalized();
  const auto contour = map.points.empty() ? 0 : map.points.back().contour + 1;
  for (double s = 0; s < (b - a).norm(); s += kSpacing_m) {
    ContourPoint p;
    p.position = (a + s * t).cast<float>();
    p.tangent = t.cast<float>();
    p.normal = t.unitOrthogonal().cast<float>();
    p.length = static_cast<float>(kSpacing_m);
    p.contour = contour;
    map.points.push_back(p);
  }
}

/// The edges of fourteen boxes in front of the flight, placed by the seed.
inline ContourMap boxes(unsigned seed = 3) {
  ContourMap map;
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> u(0, 1);
  for (int i = 0; i < 14; ++i) {
    const Eigen::Vector3d low(3 + 2 * u(random), 1 + 3.4 * u(random), 0.2 + 2 * u(random));
    const Eigen::Vector3d high =
        low + Eigen::Vector3d(0.2 + 0.5 * u(random), 0.2 + 0.6 * u(random), 0.2 + 0.6 * u(random));
    const auto corner = [&](int k) {
      return Eigen::Vector3d((k & 1) ? high.x() : low.x(), (k & 2) ? high.y() : low.y(),
                             (k & 4) ? high.z() : low.z());
    };
    for (int k = 0; k < 8; ++k)
      for (const int bit : {1, 2, 4})
        if (!(k & bit)) add_edge(map, corner(k), corner(k | bit));
  }
  return map;
}

/// Every contour from there on along y twice: in its place, and moved by `to_twin`.
inline ContourMap with_twins(const ContourMap& map, const Eigen::Vector3d& to_twin, double from_y_m = 0) {
  ContourMap out = map;
  const std::uint32_t first = map.points.back().contour + 1;
  for (ContourPoint p : map.points) {
    if (p.position.y() < from_y_m) continue;
    p.position += to_twin.cast<float>();
    p.contour += first;
    out.points.push_back(p);
  }
  return out;
}

struct TimedEvent {
  double t_s;
  Event event;
};

/// Makes the events of a world's points step by step.
class EdgeEvents {
 public:
  static constexpr double kStep_s = 2.5e-4;

  EdgeEvents(const ContourMap& world, const Camera& camera) : world_(world), camera_(camera) {
    before_.resize(world.points.size());
  }

  /// Appends the events between the last call's time, a step ago, and this one; none if `silent`.
  void advance(double t_s, bool silent, std::vector<TimedEvent>& out) {
    const Pose T_cam_map = (pose_at(t_s) * camera_on_body()).inverse();
    for (std::size_t k = 0; k < world_.points.size(); ++k) {
      const Eigen::Vector3d x = T_cam_map * world_.position(k);
      Matrix23d J;
      auto pixel = x.z() > 0.3 ? camera_.project(x, &J) : std::nullopt;
      if (pixel && !camera_.size().contains(*pixel)) pixel.reset();
      if (pixel && before_[k] && !silent) {
        // An event when the edge reaches the middle of a pixel, along the axis that it runs across.
        const Eigen::Vector2d along = J * (T_cam_map.q * world_.points[k].tangent.cast<double>());
        const int axis = std::abs(along.x()) > std::abs(along.y()) ? 1 : 0;
        const double a = (*before_[k])[axis], b = (*pixel)[axis];
        if (std::floor(a) != std::floor(b)) {
          const double line = std::max(std::floor(a), std::floor(b)), share = (line - a) / (b - a);
          const Eigen::Vector2d at = *before_[k] + share * (*pixel - *before_[k]);
          const bool rising = b > a;
          out.push_back(
              {t_s - kStep_s + share * kStep_s,
               make_event(0, static_cast<int>(std::lround(at.x())), static_cast<int>(std::lround(at.y())),
                          rising == (world_.points[k].contour % 2 == 0))});
        }
      }
      before_[k] = pixel;
    }
  }

 private:
  const ContourMap& world_;
  const Camera& camera_;
  std::vector<std::optional<Eigen::Vector2d>> before_;
};

/// All events of a flight of so long.
inline std::vector<TimedEvent> record(const ContourMap& world, const Camera& camera, double flight_s) {
  EdgeEvents edges(world, camera);
  std::vector<TimedEvent> out;
  for (int i = 0; i * EdgeEvents::kStep_s < flight_s; ++i) edges.advance(i * EdgeEvents::kStep_s, false, out);
  return out;
}

/// Those from a time on and before another one, in their order, with the flight's time as stamps.
inline std::vector<FilteredEvent> filtered_between(std::span<const TimedEvent> events, double from_s,
                                                   double to_s) {
  std::vector<FilteredEvent> out;
  for (const TimedEvent& e : events) {
    if (e.t_s < from_s || e.t_s >= to_s) continue;
    FilteredEvent f{};
    f.x = e.event.x;
    f.y = e.event.y;
    f.on = e.event.on;
    f.stamp_us = static_cast<std::uint32_t>(1e6 * e.t_s);
    out.push_back(f);
  }
  return out;
}

/// A packet of events in order of time that begins at base_s. The times of the events, in whole microseconds,
/// do not depend on it.
inline EventPacket make_packet(std::span<TimedEvent> events, double base_s) {
  std::sort(events.begin(), events.end(), [](const auto& p, const auto& q) { return p.t_s < q.t_s; });
  EventPacket packet;
  packet.base = (kStart_ns + from_seconds(base_s)) / kNsPerUs * kNsPerUs;
  for (const TimedEvent& e : events) {
    packet.events.push_back(e.event);
    packet.events.back().dt_us = static_cast<std::uint32_t>(
        std::max<TimeNs>(0, (kStart_ns + from_seconds(e.t_s) - packet.base) / kNsPerUs));
  }
  return packet;
}

}  // namespace evpose::test_flight
