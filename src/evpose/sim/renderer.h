// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/core/pose.h"
#include "evpose/sim/scene.h"

namespace evpose {
class ThreadPool;
}

namespace evpose::sim {

/// What the pixels see, row by row.
struct Frame {
  std::vector<float> radiance;     ///< mean over the pixel's area; white paper in full light is about 1
  std::vector<float> depth_m;      ///< z of the pixel's centre in the camera frame
  std::vector<std::int32_t> face;  ///< at the pixel's centre
};

/// Ray casts a scene. Each pixel integrates its area: textures by their exact mean over the pixel's
/// footprint, pixels that faces share by 16 samples, so that an edge passes through a pixel smoothly.
class Renderer {
 public:
  /// Keeps references. The camera must see less than a half space; the scene must be a room around it.
  Renderer(const Scene& scene, const Camera& camera);

  void render(const Pose& T_map_cam, ThreadPool& pool, Frame& frame) const;

  /// Largest motion of the image, px/s, for a camera that moves with `velocity` (m/s) and `rate` (rad/s),
  /// both in the camera frame; over a grid of pixels of the frame.
  double image_speed(const Frame& frame, const Eigen::Vector3d& velocity_cam,
                     const Eigen::Vector3d& rate_cam) const;

  ImageSize size() const { return size_; }

 private:
  struct Ray {
    Eigen::Vector2d direction;            ///< x / z, y / z of the pixel's centre
    Eigen::Vector2d per_column, per_row;  ///< its change from pixel to pixel
  };
  struct Tile {
    int x0, y0, x1, y1;         ///< pixels [x0, x1) x [y0, y1)
    Eigen::Vector2d low, high;  ///< least and greatest x / z, y / z of its pixels' areas
  };
  struct BoxView;
  struct PixelHit;
  using Candidates = std::vector<const BoxView*>;

  std::vector<BoxView> view_boxes(const Pose& T_map_cam) const;
  void candidates(const Tile& tile, const std::vector<BoxView>& boxes, Candidates& out) const;
  PixelHit trace(const Eigen::Vector3d& direction, const Candidates& boxes) const;
  double shade(const BoxView& box, BoxSide side, const Eigen::Vector3d& point,
               const Eigen::Vector3d& direction, double distance, const Ray& ray) const;
  void render_centres(const Tile& tile, const Candidates& boxes, Frame& frame) const;
  void refine_borders(const Tile& tile, const Candidates& boxes, Frame& frame) const;
  bool cut(const Ray& ray, Face face, const Candidates& boxes) const;
  double shared_pixel(const Ray& ray, const Candidates& boxes) const;

  const Scene& scene_;
  ImageSize size_;
  std::vector<Ray> rays_;
  std::vector<Tile> tiles_;
  struct Probe {
    std::size_t pixel;
    Eigen::Vector3d direction;
    Matrix23d jacobian;  ///< d pixel / d point at depth 1
  };
  std::vector<Probe> probes_;
};

}  // namespace evpose::sim
