// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "evpose/map_build/edge_profile_fit.h"
#include "evpose/map_build/outlines.h"
#include "evpose/map_build/planes.h"
#include "evpose/map_build/step_fit.h"

namespace evpose::map_build {

class Neighbours;

/// A straight or round stretch along which a plane may end, in the plane's frame; the surface is on its left.
struct Edge {
  Eigen::Vector2d middle, along, out;  ///< `out`: unit, out of the surface
  double half_length;                  ///< metres, along the edge
  double bend = 0;                     ///< 1 / radius, positive where the surface is inside the circle

  static Edge between(const Eigen::Vector2d& a, const Eigen::Vector2d& b);
  /// Outwards, and turned by a slope; an arc becomes wider or narrower.
  void shift(double place, double slope);
  /// Along the edge and outwards, from its middle. Of an arc the second is such that areas stay the same: a
  /// plane's points fill them evenly.
  Eigen::Vector2d local(const Eigen::Vector2d& p) const;
  /// The place that lies `t` metres along the edge.
  Eigen::Vector2d at(double t) const;
  Eigen::Vector2d along_at(double t) const;
};

/// What was found along an edge.
struct FittedEdge {
  enum class Verdict { sharp, soft, unclear };
  Verdict verdict = Verdict::unclear;  ///< soft: the surface fades out, as a shadow of moving scans does
  Edge edge;                           ///< where the surface ends
  EdgeProfileFit profile;              ///< its second face; `side` is 0 if there is none
  double across_m = 0;                 ///< error within the plane, 1 sigma
  double moved_m = 0;  ///< error across the plane, or what the edge's softness may have moved it by
};

/// Fits where a plane ends to all points near an edge.
class EdgeFitter {
 public:
  /// `cell_m`: of the outline that the edges are from. Keeps references.
  EdgeFitter(const SurfacePoints& surface, const Neighbours& tree, const FittedPlane& plane, double cell_m,
             double most_blur_noise);
  FittedEdge fit(const Edge& edge) const;
  const PlaneFrame& frame() const { return frame_; }

 private:
  std::vector<Eigen::Vector3d> local_points(const Edge& edge, double reach) const;
  struct OwnPoints {
    std::vector<Eigen::Vector3d> points;  ///< along, outwards, over the plane
    bool one_side = false;                ///< only those on one side of the plane
  };
  OwnPoints own_points(const std::vector<Eigen::Vector3d>& local, double half_width) const;
  static StepFit likeliest(const std::vector<Eigen::Vector3d>& points, double half_length, double half_width,
                           double shear, std::span<const double> blurs);
  std::optional<EdgeProfileFit> second_face(const Edge& edge) const;
  StepFit move_to_density_step(Edge& edge) const;

  const SurfacePoints& surface_;
  const Neighbours& tree_;
  const FittedPlane& plane_;
  PlaneFrame frame_;
  double cell_m_, most_blur_noise_;
  double noise_m_;  ///< of the plane's points
};

}  // namespace evpose::map_build
