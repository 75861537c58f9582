// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/sensors/lidar.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>

#include "evpose/core/config.h"
#include "evpose/core/parallel.h"
#include "evpose/sim/sensors/lidar_faults.h"
#include "evpose/sim/world/moved_furniture.h"
#include "evpose/sim/world/random.h"
#include "evpose/sim/world/texture.h"

namespace evpose::sim {
namespace {

using Eigen::Vector3d;

constexpr double kDegree = std::numbers::pi / 180;
constexpr std::uint64_t kStream = 1ULL << 41;
constexpr double kMostPoints = 5e7;

/// Surface at a hit point.
struct Surface {
  Vector3d normal;  ///< unit
  double reflectance = 0;
};

Surface surface_at(const Scene& scene, const RayHit& hit, const Vector3d& point, double footprint_m) {
  const Mesh& mesh = scene.mesh;
  const Mesh::Corners& corners = mesh.triangles[hit.triangle];
  const auto corner = [&](std::size_t i) -> Vector3d { return mesh.vertices[corners[i]].cast<double>(); };
  const Vector3d a = corner(0), ab = corner(1) - a, ac = corner(2) - a;
  const Vector3d cross = ab.cross(ac);
  Surface surface;
  surface.normal = cross.normalized();
  const Material& material = scene.materials[static_cast<std::size_t>(mesh.material[hit.triangle])];
  surface.reflectance = material.reflectance;
  if (material.texture) {
    const double area = cross.squaredNorm();
    const double b = (point - a).cross(ac).dot(cross) / area, c = ab.cross(point - a).dot(cross) / area;
    const auto& uv = mesh.uv[hit.triangle];
    const Eigen::Vector2f at =
        static_cast<float>(1 - b - c) * uv[0] + static_cast<float>(b) * uv[1] + static_cast<float>(c) * uv[2];
    const auto size = static_cast<float>(footprint_m);
    surface.reflectance *= material.texture->mean(at.x(), at.y(), {size, 0}, {0, size});
  }
  return surface;
}

}  // namespace

LidarConfig::LidarConfig() {
  flight.kind = TrajectoryKind::lissajous;
  flight.duration_s = 20;
  flight.speed_m_s = 1;
  flight.turn_deg_s = 36;
  flight.rate_deg_s = 40;
  flight.sway_deg = 3;
}

void describe(ConfigTable& table, LidarConfig& c) {
  table.add("on", c.on, "map the world by LiDAR: map_raw.ply");
  table.add("points_per_s", c.points_per_s, "1/s", "pulse rate", {1, 1e7});
  table.add("keep_every", c.keep_every, "", "every n-th point is kept", {1, 1000000});
  table.add("scan_s", c.scan_s, "s", "length of a scan", {1e-3, 100});
  table.add("down_deg", c.down_deg, "deg", "lower limit of the field of view", {-89, 89});
  table.add("up_deg", c.up_deg, "deg", "upper limit of the field of view", {-89, 89});
  table.add("mount_pitch_deg", c.mount_pitch_deg, "deg", "pitch of the sensor, positive down", {-180, 180});
  table.add("range_sigma_m", c.range_sigma_m, "m", "noise along the beam, 1 sigma", {0, 10});
  table.add("range_min_m", c.range_min_m, "m", "shortest range", {0, 1000});
  table.add("range_max_m", c.range_max_m, "m", "longest range", {0.1, 1e4});
  table.add("max_incidence_deg", c.max_incidence_deg, "deg",
            "no return from surfaces at a larger angle of incidence", {1, 90});
  table.add("beam_deg", c.beam_deg, "deg", "full divergence of a beam", {0, 5});
  table.add("mixed_m", c.mixed_m, "m", "limit of the mixed-pixel error at a depth step", {0, 10});
  table.add("registration_m", c.registration_m, "m", "position error of each scan, 1 sigma", {0, 10});
  table.add("registration_deg", c.registration_deg, "deg", "attitude error of each scan, 1 sigma", {0, 90});
  table.add("registration_drift_mm_per_10m", c.registration_drift_mm_per_10m, "mm",
            "drift of the registered scans over 10 m of way, each axis, 1 sigma", {0, 1000});
  table.add("missing_parts", c.missing_parts, "",
            "fraction of the scanned surface that the cloud lacks, in parts", {0, 0.95});
  table.add("moved_furniture", c.moved_furniture, "",
            "pieces of furniture that stood 5 to 50 cm elsewhere when the scan was made", {0, 1000});
  table.group("flight", c.flight);
}

Vector3d lidar_beam(const LidarConfig& c, double t_s) {
  // Elevation strokes while the head rotates. The frequencies are incommensurate, so that later revolutions
  // fill the gaps of earlier ones.
  constexpr double kTurn_hz = 10.3819660113;
  constexpr double kStroke_hz = 2000 / std::numbers::phi;
  const double azimuth = 2 * std::numbers::pi * std::fmod(kTurn_hz * t_s, 1.0);
  const double stroke = std::fmod(kStroke_hz * t_s, 1.0);
  const double elevation =
      kDegree * std::lerp(c.down_deg, c.up_deg, stroke < 0.5 ? 2 * stroke : 2 - 2 * stroke);
  return {std::cos(elevation) * std::cos(azimuth), std::cos(elevation) * std::sin(azimuth),
          std::sin(elevation)};
}

Lidar::Lidar(const RayCaster& rays, const Trajectory& trajectory, const LidarConfig& config,
             std::uint64_t seed)
    : rays_(rays),
      trajectory_(trajectory),
      config_(config),
      seed_(seed),
      drift_(registration_drift(trajectory, config, seed)) {}

int Lidar::scans() const {
  return static_cast<int>(std::ceil(trajectory_.duration_s() / config_.scan_s - 1e-9));
}

std::vector<CloudPoint> Lidar::scan(int number) const {
  Random random(seed_, kStream + static_cast<std::uint64_t>(number));
  const auto normal = [&](double sigma) {
    const double x = random.normal(), y = random.normal(), z = random.normal();
    return Vector3d(sigma * x, sigma * y, sigma * z);
  };
  const double start_s = config_.scan_s * number,
               end_s = std::min(start_s + config_.scan_s, trajectory_.duration_s());
  const Pose T_body_lidar{so3::exp({0, kDegree * config_.mount_pitch_deg, 0}), Vector3d::Zero()};
  // The registration error rotates and shifts a scan about the sensor.
  const Pose T_map_middle = trajectory_.at(0.5 * (start_s + end_s)).T_map_body;
  const Pose& drift = drift_[static_cast<std::size_t>(number)];
  const Vector3d shift = drift.p + normal(config_.registration_m);
  const Eigen::Quaterniond turn = drift.q * so3::exp(normal(kDegree * config_.registration_deg));
  const double least_cosine = std::cos(kDegree * config_.max_incidence_deg);
  const double radius = std::tan(0.5 * kDegree * config_.beam_deg);
  const double spacing_s = config_.keep_every / config_.points_per_s;

  std::vector<CloudPoint> points;
  const auto first = static_cast<std::int64_t>(std::ceil(start_s / spacing_s - 1e-9));
  for (std::int64_t i = first;; ++i) {
    const double t_s = spacing_s * static_cast<double>(i);
    if (t_s >= end_s - 1e-12) break;
    const Pose T_map_lidar = trajectory_.at(t_s).T_map_body * T_body_lidar;
    const Vector3d beam = T_map_lidar.q * lidar_beam(config_, t_s);
    const double noise_m = config_.range_sigma_m * random.normal();
    const auto far = static_cast<float>(config_.range_max_m);
    const auto hit = rays_.trace(T_map_lidar.p, beam, 0, far);
    if (!hit) continue;
    const double centre_m = hit->distance;
    const Vector3d point = T_map_lidar.p + centre_m * beam;
    const Surface surface = surface_at(rays_.scene(), *hit, point, 2 * radius * centre_m);
    if (std::abs(surface.normal.dot(beam)) < least_cosine) continue;

    // Mixed pixel: the rim of the beam measures other ranges at a depth step.
    const Vector3d across = beam.unitOrthogonal(), other = beam.cross(across);
    double sum = centre_m;
    int echoes = 1;
    for (const auto& [x, y] : std::array<std::pair<double, double>, 4>{{{1, 0}, {-1, 0}, {0, 1}, {0, -1}}}) {
      if (config_.mixed_m <= 0 || radius <= 0) break;
      const Vector3d rim = beam + radius * (x * across + y * other);
      if (const auto echo = rays_.trace(T_map_lidar.p, rim, 0, far)) sum += echo->distance, ++echoes;
    }
    const double mixed = std::clamp(sum / echoes - centre_m, -config_.mixed_m, config_.mixed_m);
    const double range = centre_m + mixed + noise_m;
    if (range < config_.range_min_m || range > config_.range_max_m) continue;
    const Vector3d measured = T_map_lidar.p + range * beam;
    const Vector3d registered = T_map_middle.p + turn * (measured - T_map_middle.p) + shift;
    points.push_back({registered.cast<float>(),
                      static_cast<std::uint8_t>(std::lround(255 * std::clamp(surface.reflectance, 0.0, 1.0))),
                      static_cast<std::uint16_t>(number)});
  }
  return points;
}

namespace {

Status check(const LidarConfig& config, const Trajectory& trajectory, int scans) {
  const double beams = trajectory.duration_s() * config.points_per_s / config.keep_every;
  if (beams > kMostPoints)
    return Error{"lidar.keep_every", text(beams, " points are too many"),
                 text("keep fewer than ", kMostPoints, " by a larger keep_every or a shorter flight")};
  constexpr int kMostScans = 65536;  // numbers in the file have 16 bits
  if (scans > kMostScans)
    return Error{"lidar.scan_s", text(scans, " scans are too many"),
                 text("make them longer: ", kMostScans, " at most")};
  if (config.up_deg <= config.down_deg)
    return Error{"lidar.up_deg", "the field of view is empty", "make it larger than lidar.down_deg"};
  return {};
}

}  // namespace

Status write_lidar(const std::string& path, const RayCaster& rays, const LidarConfig& config,
                   std::uint64_t seed, ThreadPool& pool) {
  if (!config.on) return {};
  const auto trajectory = make_trajectory(config.flight);
  if (!trajectory) return trajectory.error();
  std::optional<Scene> before;  // as it was when the scan was made
  std::optional<RayCaster> rays_before;
  if (config.moved_furniture > 0) {
    auto moved = with_moved_furniture(rays.scene(), config.moved_furniture, seed);
    if (!moved) return moved.error();
    rays_before.emplace(before.emplace(*std::move(moved)));
  }
  const Lidar lidar(rays_before ? *rays_before : rays, *trajectory, config, seed);
  if (Status fine = check(config, *trajectory, lidar.scans()); !fine) return fine;
  std::vector<std::vector<CloudPoint>> scans(static_cast<std::size_t>(lidar.scans()));
  pool.for_chunks(scans.size(), 1, [&](std::size_t chunk, std::size_t, std::size_t) {
    scans[chunk] = lidar.scan(static_cast<int>(chunk));
  });
  std::vector<CloudPoint> cloud;
  for (std::vector<CloudPoint>& points : scans) {
    cloud.insert(cloud.end(), points.begin(), points.end());
    points = {};
  }
  leave_out_parts(config.missing_parts, seed, cloud);
  return write_ply_cloud(path, cloud);
}

}  // namespace evpose::sim
