// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/hypothesis_refiner.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstddef>

namespace evpose {
namespace {

// From the accuracy of the coarse search to the gate of the tracker.
constexpr std::array<double, 4> kGates_px{3, 1.5, 0.8, 0.5};
constexpr int kStepsPerGate = 3;           // of Gauss-Newton, each with a new association
constexpr double kContrastReach_px = 0.1;  // below every gate, so that no band is wider than its gate
constexpr std::size_t kIntervals = 5;      // looked at together: with fewer, velocity drifts from the truth
constexpr double kPriorSigma_m = 0.02, kPriorSigma_rad = 0.01;  // of a hypothesis before it is refined
constexpr double kPriorSigma_m_s = 0.3;                         // of its velocity, once that is known
constexpr int kVelocityKnownAfter = 3;                          // slices
// Points: each is projected twelve times in each interval, so that there are fewer than in tracking.
constexpr double kPointStride_px = 6;
constexpr int kPoints = 1000;
constexpr double kPointMargin_px = 60, kPointRefresh_px = 48;  // hypotheses near each other share them
constexpr std::size_t kGatesWhenKnown = 2;  // the narrowest ones, once the velocity is known

VisibleSetConfig points_to_refine(VisibleSetConfig config) {
  config.stride_px = kPointStride_px;
  config.budget = kPoints;
  config.margin_px = kPointMargin_px;
  config.refresh_px = kPointRefresh_px;
  return config;
}

/// Contrast is not known from a pose that may be wrong, so polarity is not asked.
EventRegistrationConfig under_gate(EventRegistrationConfig config, double gate_px) {
  config.gate_px = gate_px;
  config.contrast_band_px = kContrastReach_px;
  config.polarity = config.polarity_tells_clutter = config.gate_truncation_correction = false;
  return config;
}

}  // namespace

HypothesisRefiner::HypothesisRefiner(const RelocalizerScene& scene, const HypothesisMotion& motion)
    : motion_(motion),
      index_(scene.index),
      segments_(scene.segments),
      camera_(scene.camera),
      map_sigma_m_(scene.registration.map_sigma_m),
      visible_(index_, camera_, points_to_refine(scene.visible)),
      intervals_(kIntervals) {
  for (const double gate_px : kGates_px)
    registrations_.emplace_back(camera_.size(), under_gate(scene.registration, gate_px), segments_.count);
}

void HypothesisRefiner::refine(PoseHypothesis& h, const Pose& T_body_cam, int slices) {
  const ContourView view{index_.map(), segments_, camera_, T_body_cam, map_sigma_m_};
  const auto& points = visible_.choose(h.nav.T_map_body * T_body_cam);
  const NavState from = h.nav;
  const std::size_t intervals = std::min(intervals_.size(), static_cast<std::size_t>(1 + 2 * slices));
  Vector9d prior_information;
  prior_information.segment<3>(0).setConstant(1 / (kPriorSigma_m * kPriorSigma_m));
  prior_information.segment<3>(3).setConstant(1 / (kPriorSigma_rad * kPriorSigma_rad));
  prior_information.segment<3>(6).setConstant(
      std::pow(slices < kVelocityKnownAfter ? kUnknownVelocitySigma_m_s : kPriorSigma_m_s, -2));
  const std::size_t first = slices < kVelocityKnownAfter ? 0 : registrations_.size() - kGatesWhenKnown;
  for (std::size_t gate = first; gate < registrations_.size(); ++gate)
    for (int step = 0; step < kStepsPerGate; ++step) {
      Registration& registration = registrations_[gate];
      Vector9d off;
      off << h.nav.T_map_body.minus(from.T_map_body), h.nav.velocity - from.velocity;
      NormalEquations equations{prior_information.asDiagonal(), -prior_information.cwiseProduct(off)};
      add_intervals(registration, view, points, intervals, h, equations);
      const Vector9d d = equations.H.ldlt().solve(equations.b);
      // The last look is at the refined pose: it only measures.
      const bool last = gate + 1 == registrations_.size() && step + 1 == kStepsPerGate;
      if (!d.allFinite() || last) continue;
      h.nav.T_map_body = h.nav.T_map_body.plus(d.head<6>());
      h.nav.velocity += d.tail<3>();
    }
}

void HypothesisRefiner::add_intervals(Registration& registration, const ContourView& view,
                                      std::span<const std::uint32_t> points, std::size_t intervals,
                                      PoseHypothesis& h, NormalEquations& equations) {
  const Matrix6d pose_covariance = Matrix6d::Zero();  // the gates are as they are
  registration.restart();
  NavState nav = h.nav;
  double age_s = 0, matched = 0, all = 0;
  for (std::size_t k = 0; k < intervals; ++k) {
    const EventInterval& interval = intervals_[k];
    const double span_s = interval.motion.dt_s;
    const BodyMotion body{nav.T_map_body, nav.velocity, motion_.angular_rate(h, interval.angular_rate)};
    project_contours(view, points, body, span_s, samples_);
    const RegistrationResult r =
        registration.measure({interval.events, interval.now_us, span_s, samples_, pose_covariance});
    h.concentration = r.gate_concentration;
    matched += r.events;
    all += static_cast<double>(interval.events.size());
    // Derivative of the pose at this age by the newest pose and velocity.
    Eigen::Matrix<double, 6, 9> J = Eigen::Matrix<double, 6, 9>::Zero();
    J.block<3, 3>(0, 0).setIdentity();
    J.block<3, 3>(0, 6) = -age_s * Eigen::Matrix3d::Identity();
    J.block<3, 3>(3, 3) = (nav.T_map_body.q.conjugate() * h.nav.T_map_body.q).toRotationMatrix();
    equations.H += J.transpose() * r.information * J;
    equations.b += J.transpose() * r.vector;
    age_s += span_s;
    nav = motion_.propagate_back(h, nav, interval.motion);
  }
  h.support = h.concentration * matched;
  h.explained = h.support / std::max(1.0, all);
}

}  // namespace evpose
