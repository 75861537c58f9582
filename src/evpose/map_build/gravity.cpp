// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_build/gravity.h"

#include <Eigen/Eigenvalues>
#include <cmath>

namespace evpose::map_build {

UpDirection find_up(const ContourMap& map) {
  constexpr double kNear = 0.26;  // rad: 15 degrees
  // Ceilings slope and floors are ramps: planes that disagree count for less, from round to round sooner.
  constexpr double kDoubted_rad[] = {0.26, 0.1, 0.04, 0.02, 0.01, 0.01, 0.01, 0.01};
  UpDirection out;
  double all = 0;
  for (const MapPlane& plane : map.planes) all += plane.inliers;
  for (const double doubted : kDoubted_rad) {
    // max over u of  sum_level w (n.u)^2 - sum_upright w (n.u)^2.
    Eigen::Matrix3d squares = Eigen::Matrix3d::Zero(), walls = Eigen::Matrix3d::Zero();
    double level_weight = 0, upright_weight = 0;
    for (const MapPlane& plane : map.planes) {
      const Eigen::Vector3d n = plane.normal.cast<double>();
      const double along = std::abs(n.dot(out.up));
      const double off = along > std::cos(kNear) ? n.cross(out.up).norm() : along;
      const double weight = plane.inliers / (1 + off * off / (doubted * doubted));
      if (along > std::cos(kNear)) {
        squares += weight * n * n.transpose();
        level_weight += plane.inliers;
      } else if (along < std::sin(kNear)) {
        squares -= weight * n * n.transpose();
        walls += plane.inliers * n * n.transpose();
        upright_weight += plane.inliers;
      }
    }
    // Walls of one direction leave the tilt along them open.
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> directions(walls);
    const bool crossing = directions.eigenvalues()[1] > 0.02 * upright_weight && upright_weight > 0;
    out.known = all > 0 && (level_weight > 0.02 * all || crossing);
    if (!out.known) return out;
    out.level_share = level_weight / all;
    out.upright_share = upright_weight / all;
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(squares);
    Eigen::Vector3d up = solver.eigenvectors().col(2);
    if (up.z() < 0) up = -up;
    out.up = up;
  }
  out.tilt_rad = std::acos(std::min(1.0, out.up.z()));
  return out;
}

void level(ContourMap& map, const Eigen::Vector3d& up) {
  const Eigen::Matrix3f R =
      Eigen::Quaterniond::FromTwoVectors(up, Eigen::Vector3d::UnitZ()).toRotationMatrix().cast<float>();
  for (ContourPoint& p : map.points) {
    p.position = R * p.position;
    p.normal = R * p.normal;
    p.normal_b = R * p.normal_b;
    p.tangent = R * p.tangent;
  }
  for (MapPlane& plane : map.planes) plane.normal = R * plane.normal;
  for (MapPolygon& polygon : map.polygons)
    for (auto& vertex : polygon.vertices) vertex = R * vertex;
  for (auto& vertex : map.occluders.vertices) vertex = R * vertex;
}

}  // namespace evpose::map_build
