// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_learn/silent_contours.h"

#include <gtest/gtest.h>

namespace evpose::map_learn {
namespace {

TEST(SilentContours, SilentIsWhatSweptMuchAndToldHardlyAnything) {
  const std::vector<double> swept{1000, 1000, 1000, 1000, 20}, events{500, 400, 10, 600, 0};
  EXPECT_EQ(silent_segments(swept, events), (std::vector<bool>{false, false, true, false, false}));
}

TEST(SilentContours, WhereNothingTellsEventsNothingIsKnown) {
  EXPECT_EQ(silent_segments({1000, 1000}, {0, 0}), (std::vector<bool>{false, false}));
}

}  // namespace
}  // namespace evpose::map_learn
