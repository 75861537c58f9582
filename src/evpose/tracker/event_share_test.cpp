// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/event_share.h"

#include <gtest/gtest.h>

namespace evpose {
namespace {

constexpr double kSpan_s = 1.0 / 300;

/// Updates under a constant rate near the contours.
double settled_share(EventShare& share, double per_s, double seconds) {
  for (double t = 0; t < seconds; t += kSpan_s) {
    const double looked_at = share.share();
    share.learn(static_cast<std::int64_t>(per_s * looked_at * kSpan_s), kSpan_s, looked_at);
  }
  return share.share();
}

TEST(EventShare, IsWholeBelowWhatIsAllowed) {
  EventShare share(6);
  EXPECT_EQ(settled_share(share, 4e6, 0.5), 1);
  EventShare unlimited(0);
  EXPECT_EQ(settled_share(unlimited, 4e9, 0.5), 1);
}

TEST(EventShare, BringsTheRateBelowWhatIsAllowedAtOnce) {
  for (const double per_s : {8e6, 20e6, 60e6}) {
    EventShare share(6);
    const double after_one_update = settled_share(share, per_s, 0.5 * kSpan_s);
    EXPECT_LT(after_one_update * per_s, 6e6);
    EXPECT_GT(after_one_update * per_s, 0.7 * 6e6);
    EXPECT_NEAR(settled_share(share, per_s, 0.5), after_one_update, 0.01) << "and stays";
  }
}

TEST(EventShare, IsWholeAgainSoonAfterABurst) {
  EventShare share(6);
  settled_share(share, 100e6, 0.05);
  EXPECT_LT(share.share(), 0.06);
  EXPECT_EQ(settled_share(share, 1e6, 0.15), 1);
}

TEST(EventShare, TheDriversLimitHoldsInAnyCase) {
  EventShare share(6);
  share.set_limit(0.3);
  EXPECT_EQ(settled_share(share, 1e6, 0.1), 0.3);
  EXPECT_LT(settled_share(share, 60e6, 0.1), 0.1);
  share.set_limit(0);
  EXPECT_EQ(settled_share(share, 1e6, 1), EventShare::kLeast);
}

}  // namespace
}  // namespace evpose
