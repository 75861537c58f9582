// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/pose_probability.h"

#include <gtest/gtest.h>

#include <cmath>

namespace evpose {
namespace {

constexpr double kUpdate_s = 3e-3, kConcentration = 0.5;

PoseEvidence look(double explained) {
  PoseEvidence out;
  out.pieces = 500;
  out.explained = explained;
  out.ratio = 2.5;
  out.worst_ratio = 1.7;
  return out;
}

/// Natural logarithm of the odds.
double log_odds(const PoseProbability& p) { return std::log(p.value() / (1 - p.value())); }

TEST(PoseProbabilityLaws, OnePoseThatWasFoundIsAsOftenRightAsWrongBeforeItIsLookedAt) {
  PoseProbability found, given;
  found.found();
  given.given();
  EXPECT_EQ(found.value(), 0.5);
  EXPECT_NEAR(given.value(), 0.98, 0.005);
  EXPECT_FALSE(given.is_believed());
}

TEST(PoseProbabilityLaws, OddsAreThoseOfIndependentLooksMultiplied) {
  PoseProbability p;
  p.found();
  const double one = PoseProbability::log_odds(look(0.3), kConcentration);
  p.add(look(0.3), kConcentration, 0.05);
  EXPECT_NEAR(log_odds(p), one, 1e-9);
  p.add(look(0.05), kConcentration, 0.1);
  EXPECT_NEAR(log_odds(p), one + 2 * PoseProbability::log_odds(look(0.05), kConcentration), 1e-9);
}

TEST(PoseProbabilityLaws, HowOftenItIsLookedDoesNotMatter) {
  PoseProbability often, seldom;
  often.found();
  seldom.found();
  for (int i = 0; i < 8; ++i) often.add(look(0.25), kConcentration, kUpdate_s);
  seldom.add(look(0.25), kConcentration, 8 * kUpdate_s);
  EXPECT_NEAR(log_odds(often), log_odds(seldom), 1e-9);
}

TEST(PoseProbabilityLaws, EachPartOfALookSpeaksForThePose) {
  const auto at = [](double explained, double ratio, double worst, double concentration) {
    PoseEvidence e = look(explained);
    e.ratio = ratio, e.worst_ratio = worst;
    return PoseProbability::log_odds(e, concentration);
  };
  const double middle = at(0.3, 2.5, 1.7, 0.5);
  EXPECT_GT(at(0.35, 2.5, 1.7, 0.5), middle);
  EXPECT_GT(at(0.3, 2.5, 2.0, 0.5), middle);
  EXPECT_GT(at(0.3, 2.5, 1.7, 0.6), middle);
  EXPECT_GT(middle, 0);
  EXPECT_LT(at(0.01, 1.1, 0.8, 0.2), 0);
}

TEST(PoseProbabilityLaws, NothingIsToldByTooFewEvents) {
  PoseProbability p;
  p.given();
  const double before = p.value();
  p.add({}, 0, 1);
  EXPECT_EQ(p.value(), before);
}

TEST(PoseProbabilityLaws, WhatWasSeenLongAgoIsNoProofForEver) {
  PoseProbability p;
  p.given();
  for (int i = 0; i < 100000; ++i) p.add(look(0.6), kConcentration, kUpdate_s);
  EXPECT_TRUE(p.is_believed());
  EXPECT_LT(p.value(), 1);
  for (int i = 0; i < 100; ++i) p.add(look(0), 0.1, kUpdate_s);
  EXPECT_LT(p.value(), 0.01);
  p.confirm();
  EXPECT_TRUE(p.is_believed());
}

}  // namespace
}  // namespace evpose
