// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/core/error.h"

#include <gtest/gtest.h>

namespace evpose {
namespace {

TEST(Error, LineIsOneLineThatATerminalCanShow) {
  EXPECT_EQ((Error{"a.csv:3", "'1\n2\r3\t4'", "mend it"}.line()), "a.csv:3: '1 2 3 4'; mend it");
  EXPECT_EQ((Error{"", "\xA3\x95\x80 \x1B[2J\x7F", ""}.line()), "??? ?[2J?");
  EXPECT_EQ((Error{"Hörsaal.ply", "±15 mm, 飛", ""}.line()), "Hörsaal.ply: ±15 mm, 飛");
  EXPECT_EQ((Error{"",
                   "\xC2\x9B"
                   "2J",
                   ""}
                 .line()),
            "?2J");  // a control character of two bytes
  EXPECT_EQ((Error{"", "cut off: \xC3", ""}.line()), "cut off: ?");
  EXPECT_EQ((Error{"", "cut off: \xE9\xA3", ""}.line()), "cut off: ??");
}

}  // namespace
}  // namespace evpose
