// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/verdict_history.h"

#include <gtest/gtest.h>

#include <cmath>

namespace evpose {
namespace {

constexpr double kLook_s = 1e-3;
constexpr double kSoon_s = 0.06, kLater_s = 0.2, kLong_s = 2;

using Look = VerdictHistory::Look;

Look look(PoseVerdict verdict) { return {verdict, kLook_s, false, true, true}; }
Look look_at_found(PoseVerdict verdict) { return {verdict, kLook_s, true, true, true}; }

void watch(VerdictHistory& history, const Look& each, double duration_s) {
  for (double t_s = 0; t_s < duration_s; t_s += kLook_s) history.add(each);
}

/// How long such looks go on until the pose is verified; kLong_s: they never do it.
double until_verified_s(VerdictHistory& history, const Look& each) {
  double t_s = 0;
  for (; t_s < kLong_s && !history.verified(); t_s += kLook_s) history.add(each);
  return t_s;
}

VerdictHistory of_found(bool map_may_be_wrong) {
  VerdictHistory out(map_may_be_wrong);
  out.found(false);
  return out;
}

double position_sigma_m(const VerdictHistory& history, bool watched = false) {
  return std::sqrt(history.doubt(watched)(0, 0));
}

TEST(VerdictHistoryLaws, APoseThatWasFoundNeedsLongerThanOneThatWasGiven) {
  VerdictHistory given(false), found = of_found(false);
  const double given_s = until_verified_s(given, look(PoseVerdict::confirmed));
  const double found_s = until_verified_s(found, look_at_found(PoseVerdict::confirmed));
  EXPECT_LT(given_s, kSoon_s);
  EXPECT_GT(found_s, 2 * given_s);
  EXPECT_LT(found_s, kLater_s);
}

TEST(VerdictHistoryLaws, NearAStartThatWasWrongAPoseNeedsLonger) {
  VerdictHistory found(false);
  found.found(true);
  EXPECT_GT(until_verified_s(found, look_at_found(PoseVerdict::confirmed)), 2 * kLater_s);
  for (const bool built : {false, true}) {
    VerdictHistory given(built);
    watch(given, look(PoseVerdict::refuted), 0.1);
    const double given_s = until_verified_s(given, look(PoseVerdict::confirmed));
    EXPECT_EQ(given_s < kSoon_s, built);
    EXPECT_EQ(given_s > 2 * kLater_s, !built);
    EXPECT_TRUE(given.verified());
  }
}

TEST(VerdictHistoryLaws, APoseThatWasVerifiedOnceIsNoStartThatWasWrong) {
  VerdictHistory history(false);
  until_verified_s(history, look(PoseVerdict::confirmed));
  watch(history, look(PoseVerdict::refuted), 0.1);
  history.found(false);
  EXPECT_LT(until_verified_s(history, look_at_found(PoseVerdict::confirmed)), kLater_s);
}

TEST(VerdictHistoryLaws, WhatIsNotSeenVerifiesNothing) {
  VerdictHistory found = of_found(false);
  Look at_rest = look_at_found(PoseVerdict::confirmed);
  at_rest.measured = false;
  EXPECT_GE(until_verified_s(found, at_rest), kLong_s);
  VerdictHistory interrupted = of_found(false);
  for (int i = 0; i < 20; ++i) {
    watch(interrupted, look_at_found(PoseVerdict::confirmed), 0.1);
    interrupted.add(look_at_found(PoseVerdict::open));
  }
  EXPECT_FALSE(interrupted.verified());
}

TEST(VerdictHistoryLaws, OneDirectionThatContestsAProbablePoseThatWasFoundTakesItTwiceTheTime) {
  VerdictHistory all_agree = of_found(false), one_contests = of_found(false);
  const double fast_s = until_verified_s(all_agree, look_at_found(PoseVerdict::confirmed));
  const double slow_s = until_verified_s(one_contests, look_at_found(PoseVerdict::contested));
  EXPECT_NEAR(slow_s, 2 * fast_s, 3 * kLook_s);
}

TEST(VerdictHistoryLaws, OneDirectionThatContestsAnImprobablePoseOnlyDelays) {
  VerdictHistory found = of_found(false);
  Look improbable = look_at_found(PoseVerdict::contested);
  improbable.probable = false;
  watch(found, look_at_found(PoseVerdict::confirmed), 0.1);
  EXPECT_GE(until_verified_s(found, improbable), kLong_s);
  EXPECT_LT(until_verified_s(found, look_at_found(PoseVerdict::confirmed)), 0.1);
}

TEST(VerdictHistoryLaws, OneDirectionThatContestsNeverConfirmsWhereContoursMayBeWrongOrThePoseWasGiven) {
  VerdictHistory built = of_found(true), given(false);
  EXPECT_GE(until_verified_s(built, look_at_found(PoseVerdict::contested)), kLong_s);
  EXPECT_GE(until_verified_s(given, look(PoseVerdict::contested)), kLong_s);
}

TEST(VerdictHistoryLaws, WhatContradictsCountsUntilThePoseIsConfirmedAgain) {
  VerdictHistory history(false);
  watch(history, look(PoseVerdict::refuted), 0.03);
  watch(history, look(PoseVerdict::open), kLong_s);
  EXPECT_FALSE(history.is_contradicted());
  watch(history, look(PoseVerdict::refuted), 0.03);
  EXPECT_TRUE(history.is_contradicted());
  EXPECT_FALSE(history.is_hopeless());
  history.add(look(PoseVerdict::confirmed));
  EXPECT_FALSE(history.is_contradicted());
  watch(history, look(PoseVerdict::refuted), 1.1);
  EXPECT_TRUE(history.is_hopeless());
  history.found(false);
  EXPECT_FALSE(history.is_contradicted());
}

/// In a map of a cloud some of the contours are where nothing is.
TEST(VerdictHistoryLaws, OneDirectionThatContestsAGivenPoseAgreesOnlyInAMapThatStatesErrors) {
  for (const bool built : {false, true}) {
    VerdictHistory history(built);
    watch(history, look(PoseVerdict::refuted), 0.1);
    history.add(look(PoseVerdict::contested));
    EXPECT_EQ(history.is_contradicted(), !built);
  }
}

TEST(VerdictHistoryLaws, OneThatWasVerifiedMayHaveADirectionWithoutEventsForLonger) {
  VerdictHistory given(false), verified(false);
  verified.verify();
  watch(given, look(PoseVerdict::contested), 0.1);
  watch(verified, look(PoseVerdict::contested), 0.1);
  EXPECT_TRUE(given.is_contested());
  EXPECT_FALSE(verified.is_contested());
  watch(verified, look(PoseVerdict::contested), 0.2);
  EXPECT_TRUE(verified.is_contested());
}

TEST(VerdictHistoryLaws, DoubtIsThatOfGPSUntilVerifiedAndSmallLater) {
  VerdictHistory found = of_found(false);
  EXPECT_GT(position_sigma_m(found, true), 1);
  until_verified_s(found, look_at_found(PoseVerdict::confirmed));
  const double at_once_m = position_sigma_m(found, true);
  EXPECT_LT(at_once_m, VerdictHistory::kFoundPosition_m);
  EXPECT_GT(at_once_m, 0.5 * VerdictHistory::kFoundPosition_m);
  watch(found, look(PoseVerdict::confirmed), kLong_s);
  EXPECT_LT(position_sigma_m(found), 1e-3);
  found.contradict();
  EXPECT_GT(position_sigma_m(found), 1);
  EXPECT_EQ(position_sigma_m(VerdictHistory(false)), 0);
}

TEST(VerdictHistoryLaws, OneThatWasVerifiedSlidesAlongTheContoursThatAreLeft) {
  VerdictHistory history(false);
  history.verify();
  watch(history, look(PoseVerdict::contested), 0.3);
  const double soon_m = position_sigma_m(history);
  watch(history, look(PoseVerdict::contested), 0.3);
  EXPECT_GT(soon_m, 0.03);
  EXPECT_NEAR(position_sigma_m(history), 2 * soon_m, 2e-3);
}

}  // namespace
}  // namespace evpose
