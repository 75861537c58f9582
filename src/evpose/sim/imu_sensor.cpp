// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/imu_sensor.h"

#include <cmath>

#include "evpose/sim/random.h"

namespace evpose::sim {

ImuSample ideal_imu(const Motion& motion, TimeNs t) {
  return {t, motion.rate, motion.T_map_body.q.conjugate() * (motion.acceleration - gravity_map())};
}

std::vector<ImuSample> simulate_imu(const Trajectory& trajectory, TimeNs duration, const ImuNoise& noise,
                                    const ImuErrors& errors, std::uint64_t seed) {
  Random random(seed, 3);
  const auto normal = [&](double sigma) {
    const double x = random.normal(), y = random.normal(), z = random.normal();
    return Eigen::Vector3d(sigma * x, sigma * y, sigma * z);
  };
  const double root_rate = std::sqrt(noise.rate_hz);
  Eigen::Vector3d gyro_bias = normal(errors.gyro_bias), accel_bias = normal(errors.accel_bias);
  std::vector<ImuSample> samples;
  for (std::int64_t i = 0;; ++i) {
    const TimeNs t = from_seconds(static_cast<double>(i) / noise.rate_hz);
    if (t > duration) return samples;
    ImuSample sample = ideal_imu(trajectory.at(to_seconds(t)), t);
    sample.gyro += gyro_bias + normal(noise.gyro_density * root_rate);
    sample.accel += accel_bias + normal(noise.accel_density * root_rate);
    samples.push_back(sample);
    gyro_bias += normal(noise.gyro_walk / root_rate);
    accel_bias += normal(noise.accel_walk / root_rate);
  }
}

}  // namespace evpose::sim
