// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/gate_concentration.h"

#include <gtest/gtest.h>

#include <cmath>

namespace evpose {
namespace {

/// Events of which a share gathers.
GateSums events(double weight, double share) { return {weight, share * weight, 0}; }

GateConcentration seen(double share) {
  GateConcentration c;
  c.add(events(200, share));
  return c;
}

TEST(GateConcentrationLaws, FewEventsAreNotBelieved) {
  GateConcentration c;
  EXPECT_EQ(c.value(), 1);
  c.add(events(40, 0));
  EXPECT_FALSE(c.known());
  EXPECT_TRUE(c.consistent());
  c.add(events(20, 0));
  EXPECT_TRUE(c.known());
  EXPECT_FALSE(c.consistent());
}

TEST(GateConcentrationLaws, EventsThatDoNotGatherTellLessWithTheSquareOfTheirShare) {
  EXPECT_EQ(seen(1).share_of_information(), 1);
  EXPECT_EQ(seen(0.5).share_of_information(), 1);
  EXPECT_NEAR(seen(0.4).share_of_information() / seen(0.2).share_of_information(), 4, 1e-12);
  EXPECT_EQ(seen(-1).value(), seen(0.1).value()) << "never so small that a division by it tells nothing";
  EXPECT_GT(seen(0).share_of_information(), 0);
}

TEST(GateConcentrationLaws, ManyEventsAreForgottenSoonAndFewLate) {
  GateConcentration many, few;
  many.add(events(1e6, 0.2)), few.add(events(60, 0.2));
  many.decay(0.05), few.decay(0.05);
  many.add(events(1e6 / std::exp(1.0), 1)), few.add(events(60 / std::exp(1.0), 1));
  EXPECT_NEAR(many.value(), 0.6, 1e-9);
  EXPECT_LT(few.value(), 0.5);
}

}  // namespace
}  // namespace evpose
