// SPDX-License-Identifier: BSD-3-Clause
// A room with boxes, and the lines that a camera sees of it, for tests.
#pragma once

#include <array>
#include <memory>
#include <random>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/core/pose.h"
#include "evpose/map/contour_map.h"
#include "evpose/relocalization/edge_lines.h"

namespace evpose::test_room {

inline std::shared_ptr<const Camera> make_room_camera() {
  return std::move(make_camera({300, 300, 159.5, 119.5, "radtan", {-0.05, 0.01, 0, 0}, {320, 240}})).value();
}

/// Camera axes in the body's: z along the body's x.
inline Pose camera_on_body() {
  Eigen::Matrix3d R;
  R << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  return {Eigen::Quaterniond(R), {0.03, 0.01, -0.02}};
}

using Segment = std::array<Eigen::Vector3d, 2>;

/// The edges of a box.
inline void add_box(const Eigen::Vector3d& low, const Eigen::Vector3d& high, std::vector<Segment>& edges) {
  const auto corner = [&](int k) {
    return Eigen::Vector3d((k & 1) ? high.x() : low.x(), (k & 2) ? high.y() : low.y(),
                           (k & 4) ? high.z() : low.z());
  };
  for (int k = 0; k < 8; ++k)
    for (const int bit : {1, 2, 4})
      if (!(k & bit)) edges.push_back({corner(k), corner(k | bit)});
}

/// A room of 6 x 5 x 3 m with things at its walls, no two alike.
inline std::vector<Segment> room(unsigned seed = 1) {
  std::vector<Segment> edges;
  add_box({0, 0, 0}, {6, 5, 3}, edges);
  std::mt19937 random(seed);
  const auto uniform = [&random](double low, double high) {
    return low + (high - low) * (static_cast<double>(random()) + 0.5) / 4294967296.0;
  };
  for (int i = 0; i < 40; ++i) {
    Eigen::Vector3d middle(uniform(0.4, 5.6), uniform(0.4, 4.6), uniform(0.3, 2.7));
    const int wall = i % 4;
    middle[wall / 2] = wall % 2 == 0 ? 0.2 : (wall / 2 == 0 ? 5.8 : 4.8);
    const Eigen::Vector3d half(uniform(0.05, 0.4), uniform(0.05, 0.4), uniform(0.05, 0.4));
    add_box(middle - half, middle + half, edges);
  }
  return edges;
}

inline ContourMap map_of(const std::vector<Segment>& edges) {
  constexpr double kSpacing_m = 0.02;
  ContourMap map;
  for (std::size_t e = 0; e < edges.size(); ++e) {
    const Eigen::Vector3d along = (edges[e][1] - edges[e][0]).normalized();
    for (double s = 0; s < (edges[e][1] - edges[e][0]).norm(); s += kSpacing_m) {
      ContourPoint p;
      p.position = (edges[e][0] + s * along).cast<float>();
      p.tangent = along.cast<float>();
      p.normal = along.unitOrthogonal().cast<float>();
      p.length = static_cast<float>(kSpacing_m);
      p.contour = static_cast<std::int32_t>(e);
      map.points.push_back(p);
    }
  }
  return map;
}

/// Where the camera sees a share of the edges, each in its longest part within the image.
inline std::vector<EdgeLine> seen_lines(const std::vector<Segment>& edges, const Camera& camera,
                                        const Pose& T_map_cam, double share, unsigned seed) {
  std::vector<EdgeLine> out;
  std::mt19937 random(seed);
  const Pose T_cam_map = T_map_cam.inverse();
  for (const Segment& edge : edges) {
    if (static_cast<double>(random()) / 4294967296.0 > share) continue;
    std::vector<Eigen::Vector2d> run, best;
    for (int k = 0; k <= 200; ++k) {
      const Eigen::Vector3d x = T_cam_map * (edge[0] + k / 200.0 * (edge[1] - edge[0]));
      const auto pixel = x.z() > 0.2 ? camera.project(x) : std::nullopt;
      if (pixel && camera.size().contains(*pixel, 2))
        run.push_back(*pixel);
      else
        run.clear();
      if (run.size() > best.size()) best = run;
    }
    if (best.size() > 1 && (best.back() - best.front()).norm() > 16)
      out.push_back({best.front(), best.back()});
  }
  return out;
}

}  // namespace evpose::test_room
