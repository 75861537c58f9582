// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/health.h"

#include <gtest/gtest.h>

namespace evpose {
namespace {

class HealthLaws : public ::testing::Test {
 protected:
  HealthLaws() { monitor_.start(0); }
  Health step(bool accepted, double sigma_px = 0.1, const std::string& refused = "no events") {
    t_ += 10 * kNsPerMs;
    return monitor_.judge({t_, accepted, accepted ? "" : refused, sigma_px}, &reason_);
  }
  HealthMonitor monitor_{HealthConfig{}};
  TimeNs t_ = 0;
  std::string reason_;
};

TEST_F(HealthLaws, InitialisesThenTracksAndSaysWhyOnce) {
  EXPECT_EQ(step(true), Health::initialising);
  for (int i = 0; i < 4; ++i) step(true);
  EXPECT_EQ(monitor_.state(), Health::tracking);
  EXPECT_FALSE(reason_.empty());
  step(true);
  EXPECT_TRUE(reason_.empty()) << "a reason belongs to a change";
}

TEST_F(HealthLaws, SilenceDegradesAndRecovers) {
  for (int i = 0; i < 10; ++i) step(true);
  for (int i = 0; i < 10; ++i) EXPECT_EQ(step(false), Health::tracking);
  EXPECT_EQ(step(false), Health::degraded);
  EXPECT_NE(reason_.find("no events"), std::string::npos);
  EXPECT_EQ(step(true), Health::tracking);
}

TEST_F(HealthLaws, GrowingCovarianceDegradesThenLoses) {
  for (int i = 0; i < 10; ++i) step(true);
  EXPECT_EQ(step(true, 3), Health::degraded);
  EXPECT_EQ(step(false, 9, "no map point in view"), Health::lost);
  EXPECT_NE(reason_.find("no map point in view"), std::string::npos);
}

TEST_F(HealthLaws, NotANumberIsLost) { EXPECT_EQ(step(true, std::nan("")), Health::lost); }

TEST_F(HealthLaws, WithoutAnyRegistrationItKeepsInitialising) {
  for (int i = 0; i < 100; ++i) EXPECT_EQ(step(false), Health::initialising);
}

}  // namespace
}  // namespace evpose
