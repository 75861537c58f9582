// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_learn/flight_events.h"

#include <algorithm>

namespace evpose::map_learn {
namespace {

constexpr double kPacket_s = 2.5e-4;
constexpr double kAhead = 0.1;  // cosine of the angle to the optical axis

}  // namespace

std::vector<Eigen::Vector3d> pixel_rays(const Camera& camera) {
  std::vector<Eigen::Vector3d> out;
  for (int y = 0; y < camera.size().height; ++y)
    for (int x = 0; x < camera.size().width; ++x) {
      const auto ray = camera.unproject({x, y});
      const bool ahead = ray && ray->z() > kAhead;
      out.push_back(ahead ? Eigen::Vector3d(*ray / ray->z()) : Eigen::Vector3d::Zero());
    }
  return out;
}

Eigen::Vector2d largest_tangents(const std::vector<Eigen::Vector3d>& rays) {
  Eigen::Vector2d out = Eigen::Vector2d::Zero();
  for (const Eigen::Vector3d& ray : rays) out = out.cwiseMax(ray.head<2>().cwiseAbs());
  return out;
}

Status for_each_packet(const TrackJob& job, const Trajectory& trajectory, int every,
                       const std::function<bool(double)>& progress, const TakePacket& take) {
  auto reader = open_events(job.recording, kPacket_s);
  if (!reader) return reader.error();
  EventPacket packet;
  const TimeNs first = trajectory.front().t, last = trajectory.back().t;
  for (int number = 0;; ++number) {
    const auto more = (*reader)->next(packet);
    if (!more) return more.error();
    if (!*more) return {};
    if (number % every != 0) continue;
    const TimeNs t = packet.time(packet.events[packet.events.size() / 2]);
    if (t < first || t > last) continue;
    take(t, state_at(trajectory, t).nav.T_map_body * job.setup.T_body_cam, packet.events);
    if (!progress(to_seconds(t - first) / std::max(1e-9, to_seconds(last - first)))) return {};
  }
}

}  // namespace evpose::map_learn
