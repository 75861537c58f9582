// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_build/gravity.h"

#include <Eigen/Eigenvalues>
#include <cmath>

namespace evpose::map_build {

UpDirection find_up(const ContourMap& map) {
  constexpr double kNear = 0.26;  // rad: 15 degrees
  constexpr int kRounds = 5;
  UpDirection out;
  double all = 0;
  for (const MapPlane& plane : map.planes) all += plane.inliers;
  for (int round = 0; round < kRounds; ++round) {
    // max over u of  sum_level w (n.u)^2 - sum_upright w (n.u)^2.
    Eigen::Matrix3d squares = Eigen::Matrix3d::Zero(), walls = Eigen::Matrix3d::Zero();
    double level_weight = 0, upright_weight = 0;
    for (const MapPlane& plane : map.planes) {
      const Eigen::Vector3d n = plane.normal.cast<double>();
      const double along = std::abs(n.dot(out.up)), weight = plane.inliers;
      if (along > std::cos(kNear)) {
        squares += weight * n * n.transpose();
        level_weight += weight;
      } else if (along < std::sin(kNear)) {
        squares -= weight * n * n.transpose();
        walls += weight * n * n.transpose();
        upright_weight += weight;
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
