// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/event_sums.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace evpose {
namespace {

struct Come {
  AssociationIndex::Owner owner;
  float age_us;
  bool on;
};

/// Events of three samples with different rules, some of them at the gates' borders.
class EventSumsLaws : public ::testing::Test {
 protected:
  EventSumsLaws() {
    for (std::size_t i = 0; i < kSamples; ++i)
      rules_[i] = {0.05F * static_cast<float>(i),
                   -0.08F,
                   0.5F + 0.1F * static_cast<float>(i),
                   -1,
                   1.5F,
                   0,
                   static_cast<std::int8_t>(i == 2),
                   static_cast<std::int8_t>(i == 1 ? -1 : 1)};
    std::mt19937 random(3);
    std::normal_distribution<float> distance(0, 0.35F);
    std::uniform_real_distribution<float> age(0, kSpan_us);
    for (int k = 0; k < 3000; ++k)
      events_.push_back({{k % static_cast<int>(kSamples), distance(random)}, age(random), random() % 2 == 0});
  }

  EventSums come() const {
    EventSums sums(0.9, true);
    sums.begin(kSamples);
    for (std::size_t i = 0; i < kSamples; ++i) sums.set_rule(i, rules_[i]);
    for (const Come& e : events_) sums.add(e.owner, e.age_us, e.on);
    return sums;
  }
  void shift(EventSums& sums, float by) const {
    for (std::size_t i = 0; i < kSamples; ++i)
      sums.set_shift(i, {by * (1 - static_cast<float>(i)), 0.4F * by / kSpan_us});
  }
  EventSums anew(float by) const {
    EventSums sums = come();
    shift(sums, by);
    sums.forget_events();
    for (const Come& e : events_) sums.add_shifted(e.owner, e.age_us, e.on);
    return sums;
  }

  static constexpr std::size_t kSamples = 3;
  static constexpr float kSpan_us = 3333;
  EventRule rules_[kSamples];
  std::vector<Come> events_;
};

TEST_F(EventSumsLaws, SumsThatFollowAreThoseThatAreMadeAnewToFirstOrder) {
  for (const float by : {0.0F, 0.008F, 0.03F}) {
    EventSums followed = come();
    shift(followed, by);
    ASSERT_TRUE(followed.follow(kSpan_us));
    const EventSums exact = anew(by);
    for (std::size_t i = 0; i < kSamples; ++i) {
      const EventSum &a = followed.sum(i), &b = exact.sum(i);
      EXPECT_GT(b.events, 200);
      EXPECT_EQ(a.events, b.events);
      EXPECT_EQ(a.gate_net, b.gate_net);
      EXPECT_EQ(a.gate_all, b.gate_all);
      // What is left is of second order: at most half the second derivative, which is below 2.
      const double second = 1.4 * 1.4 * by * by * b.events + 1e-4;
      EXPECT_NEAR(a.weight, b.weight, second) << by;
      EXPECT_NEAR(a.offset, b.offset, second) << by;
      EXPECT_NEAR(a.square, b.square, second) << by;
    }
    EXPECT_EQ(followed.wrong_polarity(), exact.wrong_polarity());
  }
}

TEST_F(EventSumsLaws, TheyFollowAtAll) {
  EventSums stay = come(), moved = come();
  shift(stay, 0), shift(moved, 0.03F);
  ASSERT_TRUE(stay.follow(kSpan_us) && moved.follow(kSpan_us));
  EXPECT_GT(std::abs(moved.sum(0).offset - stay.sum(0).offset), 0.4 * 0.03 * stay.sum(0).weight);
}

TEST_F(EventSumsLaws, WhatIsTooFarIsToldAndChangesNothing) {
  EventSums sums = come();
  shift(sums, 0.06F);
  const double before = sums.sum(0).offset;
  EXPECT_FALSE(sums.follow(kSpan_us));
  EXPECT_EQ(sums.sum(0).offset, before);
}

TEST_F(EventSumsLaws, ExcludedPolaritiesAreCountedAndLeftOut) {
  const EventSums sums = anew(0);
  EXPECT_LT(sums.sum(2).events, 0.6 * sums.sum(2).gate_all);
  EXPECT_EQ(sums.sum(2).gate_all - sums.sum(2).events, sums.wrong_polarity());
  EXPECT_EQ(sums.sum(0).gate_all, sums.sum(0).events);
}

TEST_F(EventSumsLaws, NothingIsLeftAfterBegin) {
  EventSums sums = anew(0);
  sums.begin(kSamples + 1);
  EXPECT_TRUE(sums.ruled().empty());
  for (std::size_t i = 0; i <= kSamples; ++i) {
    EXPECT_FALSE(sums.has_rule(i));
    EXPECT_EQ(sums.sum(i).gate_all, 0);
    EXPECT_EQ(sums.sum(i).weight, 0);
  }
}

}  // namespace
}  // namespace evpose
