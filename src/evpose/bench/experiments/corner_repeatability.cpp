// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/bench/experiments/corner_repeatability.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <optional>

#include "evpose/bench/experiments/arc_corners.h"
#include "evpose/map/depth_buffer.h"

namespace evpose::experiments {
namespace {

constexpr TimeNs kWindow = 5 * kNsPerMs;
constexpr std::array<int, 3> kLags{2, 10, 20};  // windows: 10, 50 and 100 ms
constexpr std::size_t kEvery = 20;              // windows from one that is looked at to the next
constexpr int kReach_px = 3;
constexpr double kMargin_px = 8, kNear_m = 0.1;
constexpr std::size_t kMostContourPoints = 20000;

struct Seen {
  TimeNs t;
  Eigen::Vector2d pixel;
};
/// Events and corners of one window.
struct Window {
  std::vector<Seen> events, corners;
};

/// Which pixels have something within reach.
class Reached {
 public:
  Reached(ImageSize size, const std::vector<Seen>& seen) : size_(size) {
    marks_.assign(static_cast<std::size_t>(size.width) * static_cast<std::size_t>(size.height), false);
    for (const Seen& s : seen)
      for (int dy = -kReach_px; dy <= kReach_px; ++dy)
        for (int dx = -kReach_px; dx <= kReach_px; ++dx)
          if (dx * dx + dy * dy <= kReach_px * kReach_px && size.contains(s.pixel, kReach_px))
            marks_[index(s.pixel + Eigen::Vector2d(dx, dy))] = true;
  }
  bool at(const Eigen::Vector2d& pixel) const { return marks_[index(pixel)]; }
  bool at_mirrored(const Eigen::Vector2d& pixel) const {
    return at(Eigen::Vector2d(size_.width - 1, size_.height - 1) - pixel);
  }

 private:
  std::size_t index(const Eigen::Vector2d& pixel) const {
    return static_cast<std::size_t>(std::lround(pixel.y())) * static_cast<std::size_t>(size_.width) +
           static_cast<std::size_t>(std::lround(pixel.x()));
  }
  ImageSize size_;
  std::vector<bool> marks_;
};

struct Share {
  std::size_t asked = 0, seen = 0, by_chance = 0;
  void add(const Reached& reached, const Eigen::Vector2d& pixel) {
    ++asked;
    seen += reached.at(pixel) ? 1 : 0;
    by_chance += reached.at_mirrored(pixel) ? 1 : 0;
  }
};

std::vector<Window> cut(const Streams& streams, std::size_t& events, std::size_t& corners) {
  const TrackJob& job = streams.job;
  const TimeNs begin = job.truth.front().t;
  std::vector<Window> out(static_cast<std::size_t>((job.truth.back().t - begin) / kWindow));
  ArcCorners detector(job.setup.camera->size());
  for (const EventPacket& packet : streams.packets)
    for (const Event& e : packet.events) {
      const TimeNs t = packet.time(e);
      const bool corner = detector.is_corner(t, e.x, e.y, e.on);
      ++events;
      corners += corner ? 1 : 0;
      const auto window = static_cast<std::size_t>(std::max<TimeNs>(t - begin, 0) / kWindow);
      if (t < begin || window >= out.size()) continue;
      const Seen seen{t, Eigen::Vector2d(e.x, e.y)};
      out[window].events.push_back(seen);
      if (corner) out[window].corners.push_back(seen);
    }
  return out;
}

/// The camera at one time, with what hides.
class CameraView {
 public:
  CameraView(const TrackJob& job, TimeNs t, const Eigen::Vector2d& tangents)
      : job_(job),
        T_map_cam_(true_pose(job.truth, t) * job.setup.T_body_cam),
        depth_(tangents, 1 / job.setup.camera->focal_px()) {
    depth_.render(*job.setup.map, T_map_cam_, kNear_m);
  }
  /// Where a point is seen, unless it is hidden or near the image's border.
  std::optional<Eigen::Vector2d> pixel(const Eigen::Vector3d& point_map) const {
    const Eigen::Vector3d point_cam = T_map_cam_.inverse() * point_map;
    if (point_cam.z() < kNear_m) return std::nullopt;
    auto pixel = job_.setup.camera->project(point_cam);
    if (!pixel || !job_.setup.camera->size().contains(*pixel, kMargin_px) || depth_.hides(point_cam))
      return std::nullopt;
    return pixel;
  }
  /// The surface's point that is seen at a pixel.
  std::optional<Eigen::Vector3d> point_at(const Eigen::Vector2d& pixel) const {
    const auto ray = job_.setup.camera->unproject(pixel);
    if (!ray || ray->z() < 1e-3) return std::nullopt;
    const auto number = depth_.triangle_at((ray->head<2>() / ray->z()).cast<float>());
    if (!number) return std::nullopt;
    const ContourMap& map = *job_.setup.map;
    const auto& corners = map.occluders.triangles[*number];
    std::array<Eigen::Vector3d, 3> at;
    for (std::size_t k = 0; k < 3; ++k)
      at[k] = map.anchor + map.occluders.vertices[static_cast<std::size_t>(corners[k])].cast<double>();
    const Eigen::Vector3d normal = (at[1] - at[0]).cross(at[2] - at[0]);
    const Eigen::Vector3d along = T_map_cam_.q * *ray;
    const double reach = normal.dot(at[0] - T_map_cam_.p) / normal.dot(along);
    if (!(reach > 0) || !std::isfinite(reach)) return std::nullopt;
    return T_map_cam_.p + reach * along;
  }

 private:
  const TrackJob& job_;
  Pose T_map_cam_;
  DepthBuffer depth_;
};

/// Half of what the image's corners see, x / z and y / z.
Eigen::Vector2d tangents_of(const Camera& camera) {
  Eigen::Vector2d out(0.1, 0.1);
  const double right = camera.size().width - 1, bottom = camera.size().height - 1;
  for (const Eigen::Vector2d& corner : {Eigen::Vector2d(0, 0), Eigen::Vector2d(right, 0),
                                        Eigen::Vector2d(0, bottom), Eigen::Vector2d(right, bottom)})
    if (const auto ray = camera.unproject(corner); ray && ray->z() > 0.1)
      out = out.cwiseMax(ray->head<2>().cwiseAbs() / ray->z());
  return out;
}

Status print_shares(const BenchRecording& recording, const RunConfig& config) {
  const auto streams = load_streams(recording, config);
  if (!streams) return streams.error();
  const TrackJob& job = streams->job;
  if (job.truth.size() < 2 || job.setup.map->occluders.triangles.empty())
    return Error{recording.folder, "no ground truth, or no mesh", "give a recording with both"};
  std::size_t events = 0, corners = 0;
  const std::vector<Window> windows = cut(*streams, events, corners);
  const Eigen::Vector2d tangents = tangents_of(*job.setup.camera);
  const ImageSize size = job.setup.camera->size();
  const TimeNs middle = job.truth.front().t + kWindow / 2;
  const auto time = [&](std::size_t w) { return middle + static_cast<TimeNs>(w) * kWindow; };
  const std::size_t step = job.setup.map->points.size() / kMostContourPoints + 1;
  std::array<Share, kLags.size()> of_corners, of_contours;
  for (std::size_t w = kEvery; w + static_cast<std::size_t>(kLags.back()) < windows.size(); w += kEvery) {
    const CameraView now(job, time(w), tangents);
    const Reached events_now(size, windows[w].events);
    std::vector<Eigen::Vector3d> corner_points, contour_points;
    for (const Seen& corner : windows[w].corners)
      if (const auto point = now.point_at(corner.pixel)) corner_points.push_back(*point);
    for (std::size_t i = 0; i < job.setup.map->points.size(); i += step) {
      const Eigen::Vector3d point = job.setup.map->position(i);
      const auto pixel = now.pixel(point);
      if (pixel && events_now.at(*pixel)) contour_points.push_back(point);
    }
    for (std::size_t lag = 0; lag < kLags.size(); ++lag) {
      const std::size_t after = w + static_cast<std::size_t>(kLags[lag]);
      const CameraView later(job, time(after), tangents);
      const Reached corners_then(size, windows[after].corners), events_then(size, windows[after].events);
      for (const auto& point : corner_points)
        if (const auto pixel = later.pixel(point)) of_corners[lag].add(corners_then, *pixel);
      for (const auto& point : contour_points)
        if (const auto pixel = later.pixel(point)) of_contours[lag].add(events_then, *pixel);
    }
  }
  std::printf("| %s | %.2f", recording.name.c_str(),
              100 * static_cast<double>(corners) / static_cast<double>(std::max<std::size_t>(1, events)));
  for (const auto* shares : {&of_corners, &of_contours})
    for (const Share& s : *shares) {
      const double asked = static_cast<double>(std::max<std::size_t>(1, s.asked));
      std::printf(" | %.1f (%.1f)", 100 * static_cast<double>(s.seen) / asked,
                  100 * static_cast<double>(s.by_chance) / asked);
    }
  std::printf(" |\n");
  std::fflush(stdout);
  return {};
}

}  // namespace

Status print_corner_repeatability(const Selection& selection) {
  const auto recordings = select_recordings(selection);
  if (!recordings) return recordings.error();
  const auto config = configure(selection.assignments);
  if (!config) return config.error();
  std::printf(
      "| recording | corners, %% of events | corners seen again after 10 ms, %% (by chance) | 50 ms | 100 ms "
      "| contour points after 10 ms, %% (by chance) | 50 ms | 100 ms |\n|---|---|---|---|---|---|---|---|\n");
  for (const BenchRecording& recording : *recordings)
    if (auto ok = print_shares(recording, *config); !ok) return ok;
  return {};
}

}  // namespace evpose::experiments
