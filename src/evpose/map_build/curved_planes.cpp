// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_build/curved_planes.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "evpose/map_build/plane_contacts.h"

namespace evpose::map_build {
namespace {

/// Narrow planes that touch at a small angle, as facets of a column do, however few points each has.
void mark_facets(const SurfacePoints& surface, const Planes& planes, std::vector<bool>& curved) {
  constexpr double kLeastSin = 0.1, kMostSin = 0.75;
  constexpr int kFewestContacts = 12;
  for (const auto& [pair, contact] : find_contacts(surface, planes)) {
    const auto first = static_cast<std::size_t>(pair.first), second = static_cast<std::size_t>(pair.second);
    const FittedPlane &a = planes.planes[first], &b = planes.planes[second];
    const double sine = a.normal.cross(b.normal).norm();
    if (contact.count < kFewestContacts || sine < kLeastSin || sine > kMostSin) continue;
    const Line line = intersection(a, b, contact.sum / contact.count);
    if (std::max(width_across(surface, a, line), width_across(surface, b, line)) > kFacetWidth_m) continue;
    curved[first] = curved[second] = true;
  }
}

}  // namespace

std::vector<bool> find_curved(const SurfacePoints& surface, const Planes& planes) {
  std::vector<bool> out(planes.planes.size(), false);
  for (std::size_t p = 0; p < planes.planes.size(); ++p) {
    const FittedPlane& plane = planes.planes[p];
    const Eigen::Vector3d u = plane.normal.unitOrthogonal(), v = plane.normal.cross(u);
    // Height over the plane as a quadratic form: 1, x, y, x^2, xy, y^2.
    Eigen::Matrix<double, 6, 6> squares = Eigen::Matrix<double, 6, 6>::Zero();
    Eigen::Matrix<double, 6, 1> right = Eigen::Matrix<double, 6, 1>::Zero();
    Eigen::Matrix2d spread = Eigen::Matrix2d::Zero();
    for (const std::uint32_t i : plane.points) {
      const Eigen::Vector3d x = surface.position[i].cast<double>() - plane.centre;
      const double a = u.dot(x), b = v.dot(x), height = plane.normal.dot(x);
      Eigen::Matrix<double, 6, 1> row;
      row << 1, a, b, a * a, a * b, b * b;
      squares += row * row.transpose();
      right += height * row;
      spread += Eigen::Vector2d(a, b) * Eigen::RowVector2d(a, b);
    }
    spread /= static_cast<double>(plane.points.size());
    const Eigen::LDLT<Eigen::Matrix<double, 6, 6>> solver(squares);
    const Eigen::Matrix<double, 6, 1> form = solver.solve(right);
    if (solver.info() != Eigen::Success || !form.allFinite()) continue;
    Eigen::Matrix2d hessian;
    hessian << 2 * form[3], form[4], form[4], 2 * form[5];
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> bend(hessian);
    const int k = std::abs(bend.eigenvalues()[1]) > std::abs(bend.eigenvalues()[0]) ? 1 : 0;
    const Eigen::Vector2d axis = bend.eigenvectors().col(k);
    // A strip of width w has the spread w / sqrt(12).
    const double width = std::sqrt(12 * axis.dot(spread * axis));
    const double turn = std::abs(bend.eigenvalues()[k]) * width;
    // The curvature's own error: that of a parabola over a strip, 12 sqrt(5) noise / (sqrt(n) w^2).
    const double sigma_turn =
        12 * std::sqrt(5.0) * plane.rms_m / (std::sqrt(static_cast<double>(plane.points.size())) * width);
    // What is seen in steps of depth must rise by one: that of uniform errors is their sigma times 12^0.5.
    const double least_rise_m = surface.noise_m.empty() ? 0 : std::sqrt(12.0) * noise_on(surface, plane);
    out[p] = turn > 0.2 && turn > 4 * sigma_turn && turn * width / 8 > least_rise_m;
  }
  mark_facets(surface, planes, out);
  return out;
}

}  // namespace evpose::map_build
