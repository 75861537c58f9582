// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/hypothesis_choice.h"

#include <gtest/gtest.h>

#include <vector>

namespace evpose {
namespace {

PoseHypothesis hypothesis(double x_m, double support, double concentration, int found = 1) {
  PoseHypothesis h;
  h.nav.T_map_body.p.x() = x_m;
  h.mean_support = support;
  h.mean_concentration = concentration;
  h.found = found;
  return h;
}

constexpr ChoiceRule kTrueMap, kSoon{.soon = true}, kCompeting{.competing = true};

TEST(HypothesisChoiceLaws, OfNoneNoneIsClear) { EXPECT_FALSE(is_clear({}, kTrueMap)); }

TEST(HypothesisChoiceLaws, AConcentratedOneHasToLeadWhatIsNotItself) {
  std::vector<PoseHypothesis> all{hypothesis(0, 100, 0.5), hypothesis(0.5, 90, 0.5),
                                  hypothesis(0.01, 99, 0.5)};
  EXPECT_FALSE(is_clear(all, kTrueMap));
  all[1].mean_support = 86;
  EXPECT_TRUE(is_clear(all, kTrueMap));
  EXPECT_FALSE(is_clear(all, kSoon));  // the other may come to its place yet,
  all[1].mean_concentration = 0.3;
  EXPECT_TRUE(is_clear(all, kSoon));  // but gathers no events there
}

TEST(HypothesisChoiceLaws, OneFarAheadIsTakenAtALowerConcentration) {
  std::vector<PoseHypothesis> all{hypothesis(0, 100, 0.25), hypothesis(0.5, 55, 0.2)};
  EXPECT_FALSE(is_clear(all, kTrueMap));
  all[1].mean_support = 49;
  EXPECT_TRUE(is_clear(all, kTrueMap));
  all[0].mean_concentration = 0.2;
  EXPECT_FALSE(is_clear(all, kTrueMap));
}

TEST(HypothesisChoiceLaws, WhereSearchesCompeteOneOfThemIsNotEnough) {
  for (const double concentration : {0.25, 0.5}) {
    const int enough = concentration > kLeastConcentration ? 2 : 3;
    EXPECT_FALSE(is_clear(std::vector{hypothesis(0, 100, concentration, enough - 1)}, kCompeting));
    EXPECT_TRUE(is_clear(std::vector{hypothesis(0, 100, concentration, enough)}, kCompeting));
  }
}

TEST(HypothesisChoiceLaws, WhereSearchesCompetePosesBesideTheOneThatManyFoundAreNoOthers) {
  std::vector<PoseHypothesis> all{hypothesis(0, 100, 0.3, 3), hypothesis(0.03, 95, 0.3)};
  EXPECT_TRUE(is_clear(all, kCompeting));
  EXPECT_FALSE(is_clear(all, kTrueMap));
  all[1].nav.T_map_body.p.x() = 0.05;
  EXPECT_FALSE(is_clear(all, kCompeting));
  all[1].mean_support = 66;
  EXPECT_TRUE(is_clear(all, kCompeting));
}

}  // namespace
}  // namespace evpose
