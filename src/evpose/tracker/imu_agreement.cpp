// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/imu_agreement.h"

#include <cmath>

#include "evpose/core/config.h"

namespace evpose {

void describe(ConfigTable& table, ImuAgreementConfig& c) {
  table.add("over_s", c.over_s, "s", "turns of gyroscope and estimate are compared over so long", {1e-3, 10});
  table.add("sigma", c.sigma, "", "a difference of so many standard deviations is a contradiction", {1, 1e9});
  table.add("distrust_s", c.distrust_s, "s", "so long after it the IMU is not relied on", {0, 1000});
}

void ImuAgreement::turn(const ImuSample& a, const ImuSample& b, const Eigen::Vector3d& gyro_bias,
                        double density) {
  const ImuIncrement step = integrate(a, b, gyro_bias, Eigen::Vector3d::Zero());
  now_.integral = (now_.integral * step.dq).normalized();
  now_.bias_integral += step.dt_s * gyro_bias;
  now_.noise += density * density * step.dt_s;
}

double ImuAgreement::judge(const FusionState& state) {
  using namespace error_state;
  const auto worst = [&state](int at) { return state.covariance.diagonal().segment<3>(at).maxCoeff(); };
  now_.t = state.t;
  now_.estimate = state.nav.T_map_body.q;
  now_.bias = state.gyro_bias;
  now_.rotation_variance = worst(kPhi);
  now_.bias_variance = worst(kBg);
  const TimeNs since = state.t - from_seconds(config_.over_s);
  while (past_.size() >= 2 && past_[1].t <= since) past_.pop_front();
  double sigmas = 0;
  if (!past_.empty() && past_.front().t <= since) {
    const Moment& then = past_.front();
    const double span_s = to_seconds(now_.t - then.t);
    // The bias is held at what it was: it must not have explained the difference away meanwhile.
    const Eigen::Vector3d explained = now_.bias_integral - then.bias_integral - span_s * then.bias;
    const Eigen::Quaterniond measured = then.integral.conjugate() * now_.integral * so3::exp(explained);
    const Eigen::Vector3d difference =
        so3::log(measured.conjugate() * then.estimate.conjugate() * now_.estimate);
    const double variance = then.rotation_variance + now_.rotation_variance + now_.noise - then.noise +
                            span_s * span_s * then.bias_variance;
    sigmas = difference.cwiseAbs().maxCoeff() / std::sqrt(variance);
    if (!(sigmas <= config_.sigma)) distrust_until_ = state.t + from_seconds(config_.distrust_s);
  }
  past_.push_back(now_);
  return sigmas;
}

}  // namespace evpose
