// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/flight/pose_spline.h"

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <array>
#include <cmath>

#include "evpose/core/error.h"

namespace evpose::sim {
namespace {

constexpr int kOrder = 6;   // control poses that influence one instant
constexpr int kBefore = 2;  // of these, before the knot at or before that time

/// Of the six uniform quintic basis functions, and their derivatives by u in [0, 1).
struct Basis {
  std::array<double, kOrder> value, first, second;
};

Basis basis(double u) {
  // Coefficients of 1, u, u^2, ..., times 120.
  static constexpr double kC[kOrder][kOrder] = {{1, -5, 10, -10, 5, -1},  {26, -50, 20, 20, -20, 5},
                                                {66, 0, -60, 0, 30, -10}, {26, 50, 20, -20, -20, 10},
                                                {1, 5, 10, 10, 5, -5},    {0, 0, 0, 0, 0, 1}};
  Basis b{};
  for (int i = 0; i < kOrder; ++i) {
    const auto& c = kC[i];
    b.value[i] = (c[0] + u * (c[1] + u * (c[2] + u * (c[3] + u * (c[4] + u * c[5]))))) / 120;
    b.first[i] = (c[1] + u * (2 * c[2] + u * (3 * c[3] + u * (4 * c[4] + u * 5 * c[5])))) / 120;
    b.second[i] = (2 * c[2] + u * (6 * c[3] + u * (12 * c[4] + u * 20 * c[5]))) / 120;
  }
  return b;
}

/// Knot before a time, and the place between it and the next.
std::pair<std::ptrdiff_t, double> locate(double t_s, double knot_s) {
  const double k = std::floor(t_s / knot_s);
  return {static_cast<std::ptrdiff_t>(k), t_s / knot_s - k};
}

}  // namespace

void AngularMotion::rotate(const Eigen::Vector3d& axis, double angle, double angle_1, double angle_2) {
  const Eigen::Quaterniond step = so3::exp(angle * axis), back = step.conjugate();
  q = q * step;
  rate = back * rate + angle_1 * axis;
  angular_acceleration = back * angular_acceleration + rate.cross(angle_1 * axis) + angle_2 * axis;
}

PoseSpline::PoseSpline(double knot_s, std::vector<Pose> control, double first_s)
    : knot_s_(knot_s), first_s_(first_s), control_(std::move(control)) {
  EVPOSE_CHECK(knot_s > 0 && !control_.empty());
  set_steps();
}

void PoseSpline::set_steps() {
  steps_.assign(control_.size(), Eigen::Vector3d::Zero());
  for (std::size_t k = 1; k < control_.size(); ++k)
    steps_[k] = so3::log(control_[k - 1].q.conjugate() * control_[k].q);
}

std::size_t PoseSpline::index(std::ptrdiff_t k) const {
  return static_cast<std::size_t>(
      std::clamp(k, std::ptrdiff_t{0}, static_cast<std::ptrdiff_t>(control_.size()) - 1));
}

BodyMotion PoseSpline::at(double t_s) const {
  // Beyond this all control poses are equal.
  const double edge_s = kOrder * knot_s_;
  const auto [knot, u] =
      locate(std::clamp(t_s, first_s_ - edge_s, duration_s() + edge_s) - first_s_, knot_s_);
  const Basis b = basis(u);
  const double per_s = 1 / knot_s_;
  BodyMotion m;
  m.T_map_body.p = m.velocity = m.acceleration = Eigen::Vector3d::Zero();
  for (int i = 0; i < kOrder; ++i) {
    const Eigen::Vector3d& p = control_[index(knot - kBefore + i)].p;
    m.T_map_body.p += b.value[i] * p;
    m.velocity += per_s * b.first[i] * p;
    m.acceleration += per_s * per_s * b.second[i] * p;
  }
  AngularMotion attitude;
  attitude.q = control_[index(knot - kBefore)].q;
  for (int i = 1; i < kOrder; ++i) {
    const std::ptrdiff_t k = knot - kBefore + i;
    if (k <= 0 || k >= static_cast<std::ptrdiff_t>(control_.size())) continue;
    double value = 0, first = 0, second = 0;
    for (int j = i; j < kOrder; ++j) value += b.value[j], first += b.first[j], second += b.second[j];
    attitude.rotate(steps_[static_cast<std::size_t>(k)], value, per_s * first, per_s * per_s * second);
  }
  m.T_map_body.q = attitude.q.normalized();
  m.rate = attitude.rate;
  m.angular_acceleration = attitude.angular_acceleration;
  return m;
}

namespace {

using Sparse = Eigen::SparseMatrix<double>;
using Columns = Eigen::Matrix<double, Eigen::Dynamic, 3>;

/// Row i: weights of the control values at time i.
Sparse design(const std::vector<double>& t_s, double knot_s, Eigen::Index count) {
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(t_s.size() * kOrder);
  for (std::size_t i = 0; i < t_s.size(); ++i) {
    const auto [knot, u] = locate(t_s[i], knot_s);
    const Basis b = basis(u);
    for (int j = 0; j < kOrder; ++j)
      entries.emplace_back(static_cast<int>(i),
                           static_cast<int>(std::clamp<Eigen::Index>(knot - kBefore + j, 0, count - 1)),
                           b.value[j]);
  }
  Sparse matrix(static_cast<Eigen::Index>(t_s.size()), count);
  matrix.setFromTriplets(entries.begin(), entries.end());
  return matrix;
}

/// Third differences, which are small for a smooth curve.
Sparse roughness(Eigen::Index count) {
  std::vector<Eigen::Triplet<double>> entries;
  const double weights[] = {-1, 3, -3, 1};
  for (int i = 0; i + 3 < count; ++i)
    for (int j = 0; j < 4; ++j) entries.emplace_back(i, i + j, weights[j]);
  Sparse matrix(std::max<Eigen::Index>(count - 3, 1), count);
  matrix.setFromTriplets(entries.begin(), entries.end());
  return matrix;
}

}  // namespace

PoseSpline PoseSpline::fit(const std::vector<double>& t_s, const std::vector<Pose>& poses, double knot_s) {
  EVPOSE_CHECK(knot_s > 0 && !t_s.empty() && t_s.size() == poses.size() && t_s.front() >= 0);
  // Weight of the roughness against one pose: bridges gaps and barely affects times that have poses.
  constexpr double kStiffness = 1e-7;
  constexpr int kRounds = 20;
  constexpr double kConverged_rad = 1e-12;
  const auto count = static_cast<Eigen::Index>(std::ceil(t_s.back() / knot_s - 1e-9)) + 1;
  const auto rows = static_cast<Eigen::Index>(poses.size());
  const Sparse a = design(t_s, knot_s, count), d = roughness(count);
  const Sparse transposed = a.transpose();
  Sparse tiny(count, count);
  tiny.setIdentity();
  // The last term makes the system regular where there are too few poses.
  const Sparse normal = transposed * a + kStiffness * Sparse(d.transpose() * d) + 1e-12 * tiny;
  const Eigen::SimplicialLDLT<Sparse> solver(normal);
  EVPOSE_CHECK(solver.info() == Eigen::Success);

  // Starts from poses interpolated between neighbours, so that the solver sees only small corrections.
  std::vector<Pose> control(static_cast<std::size_t>(count));
  std::size_t i = 0;
  for (std::size_t k = 0; k < control.size(); ++k) {
    const double t = knot_s * static_cast<double>(k);
    while (i + 1 < t_s.size() && t_s[i + 1] <= t) ++i;
    control[k] = i + 1 < t_s.size() ? interpolate(poses[i], poses[i + 1],
                                                  std::clamp((t - t_s[i]) / (t_s[i + 1] - t_s[i]), 0.0, 1.0))
                                    : poses[i];
  }
  PoseSpline spline(knot_s, std::move(control));
  for (int round = 0; round < kRounds; ++round) {
    Columns turn(rows, 3), move(rows, 3);
    for (Eigen::Index r = 0; r < rows; ++r) {
      const Pose now = spline.at(t_s[static_cast<std::size_t>(r)]).T_map_body;
      const Pose& wanted = poses[static_cast<std::size_t>(r)];
      move.row(r) = (wanted.p - now.p).transpose();
      turn.row(r) = so3::log(now.q.conjugate() * wanted.q).transpose();
    }
    Columns smooth(count, 3);
    for (Eigen::Index k = 0; k < count; ++k)
      smooth.row(k) = spline.control_[static_cast<std::size_t>(k)].p.transpose();
    const Columns curvature = kStiffness * (d.transpose() * (d * smooth));
    const Columns position_step = solver.solve(Columns(transposed * move - curvature));
    const Columns rotation_step = solver.solve(Columns(transposed * turn));
    for (Eigen::Index k = 0; k < count; ++k) {
      Pose& pose = spline.control_[static_cast<std::size_t>(k)];
      pose.p += position_step.row(k).transpose();
      pose.q = (pose.q * so3::exp(rotation_step.row(k).transpose())).normalized();
    }
    spline.set_steps();
    if (round > 0 && rotation_step.cwiseAbs().maxCoeff() < kConverged_rad) break;
  }
  return spline;
}

}  // namespace evpose::sim
