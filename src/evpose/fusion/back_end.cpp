// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/fusion/back_end.h"

#include <Eigen/LU>

#include "evpose/core/error.h"
#include "evpose/fusion/ekf.h"
#include "evpose/fusion/graph.h"
#include "evpose/fusion/particle_filter.h"

namespace evpose {

Eigen::MatrixXd BackEnd::seen_covariance() const {
  static_assert(error_state::kV == 6);
  return state().covariance.topLeftCorner<9, 9>();
}

void BackEnd::update(const SeenMeasurement& measurement) {
  EVPOSE_CHECK(measurement.vector.size() == SeenMeasurement::kNumbers);
  constexpr int v = SeenMeasurement::kVelocity;
  const Eigen::MatrixXd& H = measurement.information;
  const Eigen::Matrix3d prior = state().covariance.block<3, 3>(error_state::kV, error_state::kV);
  const Eigen::Matrix3d of_velocity = H.block<3, 3>(v, v) + prior.inverse();
  const Eigen::Matrix<double, 6, 3> gain = H.block<6, 3>(0, v) * of_velocity.inverse();
  update(PoseInformation{H.topLeftCorner<6, 6>() - gain * H.block<3, 6>(v, 0),
                         measurement.vector.head<6>() - gain * measurement.vector.segment<3>(v)},
         {});
}

std::unique_ptr<BackEnd> make_back_end(MotionModel model, const FusionConfig& config, const ImuNoise& noise,
                                       const Pose& T_body_cam) {
  const StatePropagator propagator(model, config, noise);
  switch (config.kind) {
    case BackEndKind::ekf:
      return std::make_unique<Ekf>(propagator, config, T_body_cam);
    case BackEndKind::graph:
      return std::make_unique<Graph>(propagator, config);
    case BackEndKind::particle:
      return std::make_unique<ParticleFilter>(propagator, config.particles);
  }
  EVPOSE_CHECK(false);
  return nullptr;
}

}  // namespace evpose
