// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/contour_trust.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "evpose/registration/rearranged.h"

namespace evpose {
namespace {

constexpr double kCommon = 0.6;  // slope of the contours that are right

/// Sums over events of weight 1/2 whose slopes scatter about a mean.
GateSums events(int count, double slope, std::mt19937& random) {
  std::normal_distribution<double> scatter(slope, 0.5);
  GateSums out;
  for (int i = 0; i < count; ++i) out += {0.5, 0.5 * scatter(random), 0};
  return out;
}

TEST(ContourTrust, ContoursThatEventsGatherAtAreTrustedAndOthersAreNot) {
  std::mt19937 random(1);
  ContourTrust trust(2);
  for (int k = 0; k < 100; ++k) {
    trust.advance(0.0033);
    trust.add(0, events(20, kCommon, random));
    trust.add(1, events(20, 0, random));
  }
  EXPECT_GT(trust.trust(0, kCommon), 0.9);
  EXPECT_LT(trust.trust(1, kCommon), 0.1);
}

TEST(ContourTrust, AFewEventsProveNothing) {
  std::mt19937 random(2);
  ContourTrust trust(2);
  EXPECT_EQ(trust.trust(1, kCommon), 1);
  trust.add(0, events(4, 0, random));
  EXPECT_GT(trust.trust(0, kCommon), 0.6);
}

TEST(ContourTrust, WhatWasSeenLongAgoIsForgotten) {
  std::mt19937 random(3);
  ContourTrust trust(1);
  trust.add(0, events(2000, 0, random));
  EXPECT_LT(trust.trust(0, kCommon), 0.1);
  trust.advance(5);
  trust.add(0, events(200, kCommon, random));
  EXPECT_GT(trust.trust(0, kCommon), 0.9);
}

TEST(ContourTrust, IsKeptWhereTheMapsSegmentsAreOthers) {
  std::mt19937 random(4);
  ContourTrust trust(2);
  trust.add(0, events(2000, 0, random));
  trust.add(1, events(2000, kCommon, random));
  const double wrong = trust.trust(0, kCommon), right = trust.trust(1, kCommon);
  trust.rearrange(std::vector<std::uint32_t>{1, kNewSegment, 0});
  EXPECT_EQ(trust.trust(0, kCommon), right);
  EXPECT_EQ(trust.trust(1, kCommon), 1);
  EXPECT_EQ(trust.trust(2, kCommon), wrong);
}

}  // namespace
}  // namespace evpose
