// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include "evpose/imu/imu.h"

namespace evpose {
namespace {

TEST(ImuAxes, WhatTheyDoIsTakenBack) {
  ImuAxes axes;
  axes.gyro << 1.01, 0.002, -0.003, 0.004, 0.99, 0.005, -0.006, 0.007, 1.02;
  axes.accel << 0.98, 0.004, 0, 0.001, 1.03, 0.002, -0.002, 0.003, 1;
  axes.gyro_by_force << 1e-4, 0, 2e-4, 0, -1e-4, 0, 0, 0, 3e-4;
  const Eigen::Vector3d rate(0.3, -1.2, 0.7), force(1, -2, 9.5);
  const ImuSample read{5, axes.gyro * rate + axes.gyro_by_force * force, axes.accel * force};
  const ImuSample corrected = axes.corrected(read);
  EXPECT_EQ(corrected.t, 5);
  EXPECT_LT((corrected.gyro - rate).norm(), 1e-14);
  EXPECT_LT((corrected.accel - force).norm(), 1e-13);
}

TEST(ImuAxes, IdealOnesLeaveEveryBit) {
  const ImuSample read{7, {0.1, 0.2, 0.3}, {1.1, 2.2, 9.3}};
  const ImuSample corrected = ImuAxes().corrected(read);
  EXPECT_EQ(corrected.gyro, read.gyro);
  EXPECT_EQ(corrected.accel, read.accel);
}

}  // namespace
}  // namespace evpose
