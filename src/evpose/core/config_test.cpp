// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/core/config.h"

#include <gtest/gtest.h>

namespace evpose {
namespace {

enum class Shape { round, square };

struct Inner {
  int count = 3;
  bool on = true;
};
struct Outer {
  double rate_hz = 300;
  std::string name = "a \"b\"";
  Shape shape = Shape::round;
  Inner inner;
};

void describe(ConfigTable& table, Inner& c) {
  table.add("count", c.count, "", "how many", {1, 10});
  table.add("on", c.on, "whether");
}
void describe(ConfigTable& table, Outer& c) {
  table.add("rate_hz", c.rate_hz, "Hz", "updates per second", {1, 5000});
  table.add("name", c.name, "a name");
  table.add("shape", c.shape, {{"round", Shape::round}, {"square", Shape::square}}, "the shape");
  table.group("inner", c.inner);
}

TEST(ConfigTable, SetsEveryKindOfValue) {
  Outer c;
  ConfigTable table;
  describe(table, c);
  EXPECT_TRUE(table.set("rate_hz", "1e2", "t").ok());
  EXPECT_TRUE(table.set("name", "x", "t").ok());
  EXPECT_TRUE(table.set("shape", "square", "t").ok());
  EXPECT_TRUE(table.set("inner.count", "7", "t").ok());
  EXPECT_TRUE(table.set("inner.on", "false", "t").ok());
  EXPECT_EQ(c.rate_hz, 100);
  EXPECT_EQ(c.name, "x");
  EXPECT_EQ(c.shape, Shape::square);
  EXPECT_EQ(c.inner.count, 7);
  EXPECT_FALSE(c.inner.on);
}

TEST(ConfigTable, UnknownKeyNamesTheNearest) {
  Outer c;
  ConfigTable table;
  describe(table, c);
  EXPECT_NE(table.set("rate_hs", "1", "--set").error().line().find("'rate_hz'"), std::string::npos);
  EXPECT_NE(table.set("count", "1", "--set").error().line().find("'inner.count'"), std::string::npos);
}

TEST(ConfigTable, RefusedValueChangesNothing) {
  Outer c;
  ConfigTable table;
  describe(table, c);
  for (const char* bad : {"", "x", "1x", "nan", "inf", "0", "5001"}) {
    EXPECT_FALSE(table.set("rate_hz", bad, "t").ok()) << bad;
    EXPECT_EQ(c.rate_hz, 300);
  }
  for (const char* bad : {"", "1.5", "0", "11", "99999999999"})
    EXPECT_FALSE(table.set("inner.count", bad, "t").ok()) << bad;
  EXPECT_FALSE(table.set("inner.on", "yes", "t").ok());
  EXPECT_FALSE(table.set("shape", "oval", "t").ok());
}

TEST(ConfigTable, YamlShowsEachKeyOnceUnderItsGroup) {
  Outer c;
  ConfigTable table;
  describe(table, c);
  EXPECT_EQ(table.to_yaml(),
            "rate_hz: 300  # updates per second [Hz]\n"
            "name: \"a \\\"b\\\"\"  # a name\n"
            "shape: \"round\"  # the shape (round | square)\n"
            "inner:\n"
            "  count: 3  # how many\n"
            "  on: true  # whether\n");
}

TEST(ConfigTable, ReprintedNumbersReadBackExactly) {
  Outer c;
  ConfigTable table;
  describe(table, c);
  const double third = 1000.0 / 3.0;
  c.rate_hz = third;
  const std::string printed = table.values().front().value;
  c.rate_hz = 0;
  ASSERT_TRUE(table.set("rate_hz", printed, "t").ok());
  EXPECT_EQ(c.rate_hz, third);
}

TEST(Words, EditDistanceIsAMetric) {
  const std::vector<std::string> words{"",     "a",   "track",  "trakc",  "tracks",
                                       "rack", "map", "kitten", "sitting"};
  EXPECT_EQ(edit_distance("kitten", "sitting"), 3u);
  EXPECT_EQ(edit_distance("", "map"), 3u);
  for (const auto& a : words)
    for (const auto& b : words) {
      EXPECT_EQ(edit_distance(a, b), edit_distance(b, a));
      EXPECT_EQ(edit_distance(a, b) == 0, a == b);
      for (const auto& c : words) EXPECT_LE(edit_distance(a, c), edit_distance(a, b) + edit_distance(b, c));
    }
}

}  // namespace
}  // namespace evpose
