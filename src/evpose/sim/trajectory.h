// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "evpose/core/pose.h"

namespace evpose::sim {

/// Where the body is and how it moves, at one instant.
struct Motion {
  Pose T_map_body;
  Eigen::Vector3d velocity;      ///< of the body's origin, map frame, m/s
  Eigen::Vector3d acceleration;  ///< map frame, m/s^2
  Eigen::Vector3d rate;          ///< body frame, rad/s
};

/// A closed form with all its derivatives: each of x, y, z (metres), yaw, pitch, roll (rad) is
/// offset + sum of (amplitude + growth t) sin(omega t + phase). R_map_body = Rz(yaw) Ry(pitch) Rx(roll).
class Trajectory {
 public:
  struct Wave {
    double amplitude, growth, omega, phase;  ///< channel's unit, per second, rad/s, rad
  };
  struct Channel {
    double offset = 0;
    std::vector<Wave> waves;
  };
  explicit Trajectory(std::array<Channel, 6> channels) : channels_(std::move(channels)) {}

  Motion at(double t_s) const;

 private:
  std::array<Channel, 6> channels_;
};

/// A square spiral that opens while the body looks along +x and sways: 0.5-0.8 m/s, up to about 20 deg/s, for
/// the first seconds in the room of make_box_room(). `seed` picks the sway.
Trajectory make_square_spiral(std::uint64_t seed);

}  // namespace evpose::sim
