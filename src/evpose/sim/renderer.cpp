// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/renderer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "evpose/core/error.h"
#include "evpose/core/parallel.h"

namespace evpose::sim {
namespace {

constexpr int kTilePx = 16;
constexpr int kProbeStep_px = 6;
constexpr int kSamples = 16;

// Places of the samples in a pixel: all columns and all rows differ, so that an edge of either direction
// passes them one by one (Hammersley's set).
std::array<Eigen::Vector2d, kSamples> sample_places() {
  std::array<Eigen::Vector2d, kSamples> places;
  for (int i = 0; i < kSamples; ++i) {
    const int reversed = (i & 1) << 3 | (i & 2) << 1 | (i & 4) >> 1 | (i & 8) >> 3;
    places[i] = Eigen::Vector2d(i + 0.5, reversed + 0.5) / kSamples - Eigen::Vector2d(0.5, 0.5);
  }
  return places;
}

Eigen::Vector3d homogeneous(const Eigen::Vector2d& m) { return {m.x(), m.y(), 1}; }

Eigen::Vector2d plane_ray(const Camera& camera, double x, double y) {
  const auto ray = camera.unproject({x, y});
  EVPOSE_CHECK(ray && ray->z() > 0);
  return ray->head<2>() / ray->z();
}

}  // namespace

// A box with everything that a ray of one camera pose needs.
struct Renderer::BoxView {
  const Box* box;
  int number;
  Eigen::Matrix3d R_box_cam;
  Eigen::Vector3d origin;  // of the camera, box frame
  Eigen::Vector3d lamp;    // box frame
  Eigen::Vector2d low,
      high;  // of x / z, y / z; everything for a box that reaches beside or behind the camera
};

struct Renderer::PixelHit {
  const BoxView* box = nullptr;
  BoxSide side = -1;
  double distance = std::numeric_limits<double>::max();
  Eigen::Vector3d direction;  // box frame
};

Renderer::Renderer(const Scene& scene, const Camera& camera) : scene_(scene), size_(camera.size()) {
  rays_.reserve(static_cast<std::size_t>(size_.width) * size_.height);
  for (int y = 0; y < size_.height; ++y) {
    for (int x = 0; x < size_.width; ++x) {
      rays_.push_back({plane_ray(camera, x, y), plane_ray(camera, x + 0.5, y) - plane_ray(camera, x - 0.5, y),
                       plane_ray(camera, x, y + 0.5) - plane_ray(camera, x, y - 0.5)});
    }
  }
  for (int y = 0; y < size_.height; y += kTilePx) {
    for (int x = 0; x < size_.width; x += kTilePx) {
      Tile tile{x, y, std::min(x + kTilePx, size_.width), std::min(y + kTilePx, size_.height), {}, {}};
      tile.low = tile.high = plane_ray(camera, x, y);
      for (int row = y; row < tile.y1; ++row) {
        for (int column = x; column < tile.x1; ++column) {
          const Ray& ray = rays_[static_cast<std::size_t>(row) * size_.width + column];
          const Eigen::Vector2d reach = 0.5 * (ray.per_column.cwiseAbs() + ray.per_row.cwiseAbs());
          tile.low = tile.low.cwiseMin(ray.direction - reach);
          tile.high = tile.high.cwiseMax(ray.direction + reach);
        }
      }
      tiles_.push_back(tile);
    }
  }
  for (int y = 0; y < size_.height; y += kProbeStep_px) {
    for (int x = 0; x < size_.width; x += kProbeStep_px) {
      const std::size_t pixel = static_cast<std::size_t>(y) * size_.width + x;
      Probe probe{pixel, homogeneous(rays_[pixel].direction), {}};
      EVPOSE_CHECK(camera.project(probe.direction, &probe.jacobian));
      probes_.push_back(probe);
    }
  }
}

// The boxes that may be seen in the tile; the room always.
void Renderer::candidates(const Tile& tile, const std::vector<BoxView>& boxes, Candidates& out) const {
  out.clear();
  for (const BoxView& box : boxes) {
    if ((box.low.array() <= tile.high.array()).all() && (box.high.array() >= tile.low.array()).all())
      out.push_back(&box);
  }
}

Renderer::PixelHit Renderer::trace(const Eigen::Vector3d& direction, const Candidates& boxes) const {
  PixelHit hit;
  for (const BoxView* box : boxes) {
    const Eigen::Vector3d in_box = box->R_box_cam * direction;
    const BoxHit at = hit_box(box->origin, in_box, box->box->half, hit.distance);
    if (at.side >= 0) hit = {box, at.side, at.distance, in_box};
  }
  EVPOSE_CHECK(hit.box != nullptr);
  return hit;
}

double Renderer::shade(const BoxView& box, BoxSide side, const Eigen::Vector3d& point,
                       const Eigen::Vector3d& direction, double distance, const Ray& ray) const {
  const int axis = axis_of(side), u = texture_u_axis(side), v = texture_v_axis(side);
  // The point's motion on the face when the ray moves by a pixel.
  const auto footprint = [&](const Eigen::Vector2d& change) {
    const Eigen::Vector3d turn = box.R_box_cam.leftCols<2>() * change;
    const double further = turn[axis] / direction[axis];
    return Eigen::Vector2d(distance * (turn[u] - further * direction[u]),
                           distance * (turn[v] - further * direction[v]));
  };
  const Eigen::Vector2d extent = footprint(ray.per_column).cwiseAbs() + footprint(ray.per_row).cwiseAbs();
  const Eigen::Vector3d& half = box.box->half;
  const double reflectance =
      box.box->faces[side].mean(point[u] + half[u], point[v] + half[v], extent[0], extent[1]);

  const Eigen::Vector3d to_lamp = box.lamp - point;
  const double distance2 = to_lamp.squaredNorm();
  const double out = box.number == 0 ? -sign_of(side) : sign_of(side);
  const double facing = std::max(0.0, out * to_lamp[axis]) / std::sqrt(distance2);
  return reflectance * (scene_.ambient + scene_.lamp_power * facing / distance2);
}

void Renderer::render_centres(const Tile& tile, const Candidates& boxes, Frame& frame) const {
  for (int y = tile.y0; y < tile.y1; ++y) {
    for (int x = tile.x0; x < tile.x1; ++x) {
      const std::size_t pixel = static_cast<std::size_t>(y) * size_.width + x;
      const Ray& ray = rays_[pixel];
      const PixelHit hit = trace(homogeneous(ray.direction), boxes);
      const Eigen::Vector3d point = hit.box->origin + hit.distance * hit.direction;
      frame.radiance[pixel] =
          static_cast<float>(shade(*hit.box, hit.side, point, hit.direction, hit.distance, ray));
      frame.depth_m[pixel] = static_cast<float>(hit.distance);
      frame.face[pixel] = face_of(hit.box->number, hit.side);
    }
  }
}

double Renderer::shared_pixel(const Ray& ray, const Candidates& boxes) const {
  static const std::array<Eigen::Vector2d, kSamples> kPlaces = sample_places();
  struct Part {
    PixelHit hit;
    Eigen::Vector3d sum_of_points;
    int count;
  };
  std::array<Part, kSamples> parts;
  int used = 0;
  for (const Eigen::Vector2d& place : kPlaces) {
    const Eigen::Vector2d m = ray.direction + place.x() * ray.per_column + place.y() * ray.per_row;
    const PixelHit hit = trace(homogeneous(m), boxes);
    const Eigen::Vector3d point = hit.box->origin + hit.distance * hit.direction;
    int i = 0;
    while (i < used && (parts[i].hit.box != hit.box || parts[i].hit.side != hit.side)) ++i;
    if (i == used) parts[used++] = {hit, Eigen::Vector3d::Zero(), 0};
    parts[i].sum_of_points += point;
    ++parts[i].count;
  }
  double radiance = 0;
  for (int i = 0; i < used; ++i) {
    const Part& part = parts[i];
    radiance += part.count * shade(*part.hit.box, part.hit.side, part.sum_of_points / part.count,
                                   part.hit.direction, part.hit.distance, ray);
  }
  return radiance / kSamples;
}

// True if a corner of the pixel sees another face than its centre.
bool Renderer::cut(const Ray& ray, Face face, const Candidates& boxes) const {
  for (const double x : {-0.5, 0.5}) {
    for (const double y : {-0.5, 0.5}) {
      const PixelHit hit = trace(homogeneous(ray.direction + x * ray.per_column + y * ray.per_row), boxes);
      if (face_of(hit.box->number, hit.side) != face) return true;
    }
  }
  return false;
}

// A pixel may be cut by an edge if one of its eight neighbours sees another face.
void Renderer::refine_borders(const Tile& tile, const Candidates& boxes, Frame& frame) const {
  for (int y = tile.y0; y < tile.y1; ++y) {
    const int up = std::max(y - 1, 0), down = std::min(y + 1, size_.height - 1);
    for (int x = tile.x0; x < tile.x1; ++x) {
      const std::size_t pixel = static_cast<std::size_t>(y) * size_.width + x;
      const std::int32_t face = frame.face[pixel];
      const int left = std::max(x - 1, 0), right = std::min(x + 1, size_.width - 1);
      bool shared = false;
      for (const int row : {up, y, down}) {
        const std::int32_t* faces = &frame.face[static_cast<std::size_t>(row) * size_.width];
        shared = shared || faces[left] != face || faces[x] != face || faces[right] != face;
      }
      if (shared && cut(rays_[pixel], face, boxes))
        frame.radiance[pixel] = static_cast<float>(shared_pixel(rays_[pixel], boxes));
    }
  }
}

std::vector<Renderer::BoxView> Renderer::view_boxes(const Pose& T_map_cam) const {
  constexpr double kNear_m = 0.05, kEverything = std::numeric_limits<double>::infinity();
  std::vector<BoxView> boxes;
  for (std::size_t b = 0; b < scene_.boxes.size(); ++b) {
    const Box& box = scene_.boxes[b];
    const Pose T_box_map = box.T_map_box.inverse(), T_cam_box = (T_box_map * T_map_cam).inverse();
    BoxView view{&box,
                 static_cast<int>(b),
                 T_cam_box.rotation().transpose(),
                 T_box_map * T_map_cam.p,
                 T_box_map * scene_.lamp,
                 Eigen::Vector2d::Constant(kEverything),
                 Eigen::Vector2d::Constant(-kEverything)};
    for (int i = 0; i < 8; ++i) {
      const Eigen::Vector3d signs(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1);
      const Eigen::Vector3d corner = T_cam_box * box.half.cwiseProduct(signs);
      if (!(corner.z() > kNear_m)) {
        view.low.setConstant(-kEverything);
        view.high.setConstant(kEverything);
        break;
      }
      view.low = view.low.cwiseMin(corner.head<2>() / corner.z());
      view.high = view.high.cwiseMax(corner.head<2>() / corner.z());
    }
    boxes.push_back(view);
  }
  return boxes;
}

void Renderer::render(const Pose& T_map_cam, ThreadPool& pool, Frame& frame) const {
  const std::vector<BoxView> boxes = view_boxes(T_map_cam);
  frame.radiance.resize(rays_.size());
  frame.depth_m.resize(rays_.size());
  frame.face.resize(rays_.size());
  const auto for_tiles = [&](void (Renderer::*work)(const Tile&, const Candidates&, Frame&) const) {
    pool.for_chunks(tiles_.size(), 8, [&](std::size_t, std::size_t begin, std::size_t end) {
      Candidates near;
      for (std::size_t i = begin; i < end; ++i) {
        candidates(tiles_[i], boxes, near);
        (this->*work)(tiles_[i], near, frame);
      }
    });
  };
  for_tiles(&Renderer::render_centres);
  for_tiles(&Renderer::refine_borders);
}

double Renderer::image_speed(const Frame& frame, const Eigen::Vector3d& velocity_cam,
                             const Eigen::Vector3d& rate_cam) const {
  double fastest2 = 0;
  for (const Probe& probe : probes_) {
    const Eigen::Vector3d motion =
        -velocity_cam / frame.depth_m[probe.pixel] - rate_cam.cross(probe.direction);
    fastest2 = std::max(fastest2, (probe.jacobian * motion).squaredNorm());
  }
  return std::sqrt(fastest2);
}

}  // namespace evpose::sim
