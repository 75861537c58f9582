// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/pose_hypothesis.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace evpose {
namespace {

// Process noise of a vehicle without an IMU.
constexpr double kVelocityNoise_m2_s3 = 10;  // accelerations of 7 m/s^2 that last a tenth of a second
constexpr double kRotationNoise_rad2_s2 = 0.1, kUnknownRate_rad2_s2 = 1.0;

// Hypotheses nearer to each other than this are one.
constexpr double kDuplicate_m = 0.005, kDuplicate_rad = 0.002, kDuplicate_m_s = 0.1;

}  // namespace

void HypothesisMotion::propagate(PoseHypothesis& h, const ImuIncrement& m, bool rate_known) const {
  const double dt = m.dt_s;
  NavState& nav = h.nav;
  nav.T_map_body.p += nav.velocity * dt + 0.5 * dt * dt * gravity_map_ + nav.T_map_body.q * m.dp;
  nav.velocity += dt * gravity_map_ + nav.T_map_body.q * m.dv;
  nav.T_map_body.q = (nav.T_map_body.q * (has_imu_ ? m.dq : so3::exp(dt * h.angular_rate))).normalized();
  h.position_variance += 2 * dt * h.position_velocity_covariance + dt * dt * h.velocity_variance;
  h.position_velocity_covariance += dt * h.velocity_variance;
  if (has_imu_) return;
  h.velocity_variance += kVelocityNoise_m2_s3 * dt;
  h.rotation_variance += (rate_known ? kRotationNoise_rad2_s2 : kUnknownRate_rad2_s2) * dt * dt;
}

NavState HypothesisMotion::propagate_back(const PoseHypothesis& h, const NavState& nav,
                                          const ImuIncrement& m) const {
  const double dt = m.dt_s;
  NavState out;
  out.T_map_body.q =
      (nav.T_map_body.q * (has_imu_ ? m.dq.conjugate() : so3::exp(-dt * h.angular_rate))).normalized();
  out.velocity = nav.velocity - dt * gravity_map_ - out.T_map_body.q * m.dv;
  out.T_map_body.p =
      nav.T_map_body.p - dt * out.velocity - 0.5 * dt * dt * gravity_map_ - out.T_map_body.q * m.dp;
  return out;
}

void correct_by_edges(PoseHypothesis& h, const Vector6d& innovation) {
  const double position_noise = std::pow(kEdgePositionSigma_m, 2),
               rotation_noise = std::pow(kEdgeRotationSigma_rad, 2);
  const double gain = 1 / (h.position_variance + position_noise);
  h.nav.T_map_body.p += gain * h.position_variance * innovation.head<3>();
  h.nav.velocity += gain * h.position_velocity_covariance * innovation.head<3>();
  h.velocity_variance -= gain * h.position_velocity_covariance * h.position_velocity_covariance;
  h.position_velocity_covariance *= gain * position_noise;
  h.position_variance *= gain * position_noise;
  const double turn = h.rotation_variance / (h.rotation_variance + rotation_noise);
  h.nav.T_map_body.q = (h.nav.T_map_body.q * so3::exp(turn * innovation.tail<3>())).normalized();
  h.rotation_variance *= rotation_noise / (h.rotation_variance + rotation_noise);
}

void merge_duplicates(std::vector<PoseHypothesis>& hypotheses) {
  std::vector<PoseHypothesis> different;
  for (const PoseHypothesis& h : hypotheses) {
    const auto same = std::ranges::find_if(different, [&](const PoseHypothesis& other) {
      const Vector6d d = h.nav.T_map_body.minus(other.nav.T_map_body);
      return d.head<3>().norm() < kDuplicate_m && d.tail<3>().norm() < kDuplicate_rad &&
             (h.nav.velocity - other.nav.velocity).norm() < kDuplicate_m_s;
    });
    if (same == different.end()) {
      different.push_back(h);
    } else if (same->newest_search != h.newest_search) {
      same->found += h.found;
      same->newest_search = std::max(same->newest_search, h.newest_search);
    }
  }
  hypotheses = std::move(different);
}

}  // namespace evpose
