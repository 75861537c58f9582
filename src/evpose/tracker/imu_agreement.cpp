// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/imu_agreement.h"

#include <algorithm>
#include <cmath>

namespace evpose {

namespace {

constexpr double kTurns_s = 0.06;   // turns of gyroscope and estimate are compared over so long
constexpr double kForces_s = 0.25;  // bends of the path by IMU and estimate are compared over so long
// While the IMU's stamps are doubted, a smaller difference is a contradiction, by this factor.
constexpr double kDoubtedShare = 0.6;
constexpr double kContradictionSigma = 2.5;  // a difference of so many standard deviations is a contradiction
constexpr double kDistrust_s = 1.0;          // so long after a contradiction the IMU is not relied on

}  // namespace

void ImuAgreement::add_step(const ImuSample& a, const ImuSample& b, const FusionState& from,
                            const Eigen::Vector3d& gravity_map, const ImuNoise& noise) {
  const ImuIncrement step = integrate(a, b, from.gyro_bias, from.accel_bias);
  now_.integral = (now_.integral * step.dq).normalized();
  now_.bias_integral += step.dt_s * from.gyro_bias;
  now_.noise += noise.gyro_density * noise.gyro_density * step.dt_s;
  const double dt = step.dt_s;
  const Eigen::Matrix3d R = from.nav.T_map_body.rotation();
  Forces forces;
  forces << R * step.dv + dt * gravity_map, dt * R * from.accel_bias, dt * R;
  now_.twice += dt * now_.once + 0.5 * dt * forces;
  now_.once += forces;
  now_.force_noise += noise.accel_density * noise.accel_density * dt;
}

const ImuAgreement::Moment* ImuAgreement::before(double back_s) const {
  const TimeNs since = now_.t - from_seconds(back_s);
  const auto oldest = past_.begin() + static_cast<std::ptrdiff_t>(first_);
  const auto after = std::upper_bound(oldest, past_.end(), since,
                                      [](TimeNs t, const Moment& moment) { return t < moment.t; });
  return after == oldest ? nullptr : &*(after - 1);
}

// In both the bias is held at what it was: it must not have explained the difference away meanwhile.

double ImuAgreement::turn_difference(const Moment& then) const {
  const double span_s = to_seconds(now_.t - then.t);
  const Eigen::Vector3d explained = now_.bias_integral - then.bias_integral - span_s * then.bias;
  const Eigen::Quaterniond measured = then.integral.conjugate() * now_.integral * so3::exp(explained);
  const Eigen::Vector3d difference =
      so3::log(measured.conjugate() * then.estimate.conjugate() * now_.estimate);
  const double variance = then.rotation_variance + now_.rotation_variance + now_.noise - then.noise +
                          span_s * span_s * then.bias_variance;
  return difference.cwiseAbs().maxCoeff() / std::sqrt(variance);
}

double ImuAgreement::bend_difference(const Moment& begin, const Moment& middle) const {
  const double first_s = to_seconds(middle.t - begin.t), second_s = to_seconds(now_.t - middle.t);
  if (first_s <= 0 || second_s <= 0) return 0;
  const double ratio = second_s / first_s;
  const auto bend = [ratio](const auto& a, const auto& b, const auto& c) {
    return (c - b - ratio * (b - a)).eval();
  };
  const Forces imu = bend(begin.twice, middle.twice, now_.twice);
  const Eigen::Vector3d measured = imu.col(0) + imu.col(1) - imu.rightCols<3>() * begin.force_bias;
  const Eigen::Vector3d difference = bend(begin.position, middle.position, now_.position) - measured;
  // White noise enters by a triangle over the two halves.
  const double density = (now_.force_noise - begin.force_noise) / (first_s + second_s);
  const double variance = ratio * ratio * begin.position_variance +
                          (1 + ratio) * (1 + ratio) * middle.position_variance + now_.position_variance +
                          density * second_s * second_s * (first_s + second_s) / 3 +
                          std::pow(0.5 * second_s * (first_s + second_s), 2) * begin.force_bias_variance;
  return difference.cwiseAbs().maxCoeff() / std::sqrt(variance);
}

double ImuAgreement::judge(const FusionState& state, bool doubted) {
  using namespace error_state;
  const auto worst = [&state](int at) { return state.covariance.diagonal().segment<3>(at).maxCoeff(); };
  now_.t = state.t;
  now_.estimate = state.nav.T_map_body.q;
  now_.bias = state.gyro_bias;
  now_.rotation_variance = worst(kPhi);
  now_.bias_variance = worst(kBg);
  now_.position = state.nav.T_map_body.p;
  now_.force_bias = state.accel_bias;
  now_.position_variance = worst(kP);
  now_.force_bias_variance = worst(kBa);
  const Moment *turned = before(kTurns_s), *middle = before(0.5 * kForces_s), *begin = before(kForces_s);
  const double sigmas = std::max(turned != nullptr ? turn_difference(*turned) : 0,
                                 begin != nullptr ? bend_difference(*begin, *middle) : 0);
  if (!(sigmas <= kContradictionSigma * (doubted ? kDoubtedShare : 1)))
    distrust_until_ = state.t + from_seconds(kDistrust_s);
  const TimeNs since = state.t - from_seconds(std::max(kTurns_s, kForces_s));
  while (first_ + 1 < past_.size() && past_[first_ + 1].t <= since) ++first_;
  if (2 * first_ > past_.size()) {
    past_.erase(past_.begin(), past_.begin() + static_cast<std::ptrdiff_t>(first_));
    first_ = 0;
  }
  past_.push_back(now_);
  return sigmas;
}

}  // namespace evpose
