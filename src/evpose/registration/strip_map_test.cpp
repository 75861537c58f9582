// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/strip_map.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace evpose {
namespace {

constexpr ImageSize kSize{160, 120};
constexpr double kHalfLength_px = 4, kAmbiguity_px = 1;

std::vector<Strip> random_strips(int count, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> x(-10, 170), y(-10, 130), angle(0, 6.28F), reach(0.5F, 6);
  std::vector<Strip> out;
  for (int i = 0; i < count; ++i) {
    const float a = angle(random);
    out.push_back({x(random), y(random), std::cos(a), std::sin(a), reach(random)});
  }
  return out;
}

float across(const Strip& s, int x, int y) {
  return std::abs(s.nx * (static_cast<float>(x) - s.x) + s.ny * (static_cast<float>(y) - s.y));
}
float along(const Strip& s, int x, int y) {
  return std::abs(s.nx * (static_cast<float>(y) - s.y) - s.ny * (static_cast<float>(x) - s.x));
}
bool covers(const Strip& s, int x, int y) {
  return across(s, x, y) <= s.reach && along(s, x, y) <= static_cast<float>(kHalfLength_px);
}
/// So near to a strip's border that rounding decides.
bool on_border(const Strip& s, int x, int y) {
  return std::abs(across(s, x, y) - s.reach) < 1e-3F ||
         std::abs(along(s, x, y) - static_cast<float>(kHalfLength_px)) < 1e-3F;
}

TEST(StripMap, OneStripOwnsWhatItCovers) {
  StripMap map(kSize, kHalfLength_px, kAmbiguity_px);
  for (const Strip& s : random_strips(200, 1)) {
    map.claim({&s, 1});
    for (int y = 0; y < kSize.height; ++y)
      for (int x = 0; x < kSize.width; ++x)
        if (!on_border(s, x, y)) {
          ASSERT_EQ(map.owner(x, y) == 0, covers(s, x, y)) << x << ' ' << y;
        }
  }
}

TEST(StripMap, GridDirectionsAreNoSpecialCase) {
  StripMap map(kSize, kHalfLength_px, kAmbiguity_px);
  for (const auto& [nx, ny] : {std::pair{1.0F, 0.0F}, {0.0F, 1.0F}, {-1.0F, 0.0F}, {0.0F, -1.0F}}) {
    const Strip s{80.25F, 60.25F, nx, ny, 2};
    map.claim({&s, 1});
    EXPECT_EQ(map.claimed()[0], 8 * 4);
  }
}

/// Two strips of different lines: the definition, pixel by pixel.
TEST(StripMap, BetweenTwoLinesTheNearerOwnsUnlessBothAreAsNear) {
  StripMap map(kSize, kHalfLength_px, kAmbiguity_px);
  for (unsigned seed = 0; seed < 200; ++seed) {
    auto pair = random_strips(2, seed);
    pair[0].x = 80, pair[0].y = 60, pair[1].x = 83, pair[1].y = 58;
    if (std::abs(pair[0].nx * pair[1].nx + pair[0].ny * pair[1].ny) > 0.97F) continue;
    map.claim(pair);
    for (int y = 40; y < 80; ++y)
      for (int x = 60; x < 100; ++x) {
        if (on_border(pair[0], x, y) || on_border(pair[1], x, y)) continue;
        const bool a = covers(pair[0], x, y), b = covers(pair[1], x, y);
        const float nearer_by = across(pair[1], x, y) - across(pair[0], x, y);
        if (std::abs(std::abs(nearer_by) - static_cast<float>(kAmbiguity_px)) < 1e-3F) continue;
        int expected = a ? 0 : b ? 1 : -1;
        if (a && b)
          expected = std::abs(nearer_by) < static_cast<float>(kAmbiguity_px) ? -1 : nearer_by > 0 ? 0 : 1;
        ASSERT_EQ(map.owner(x, y), expected) << seed << ": " << x << ' ' << y;
      }
  }
}

TEST(StripMap, NeighboursOfOneLineShareItEvenly) {
  StripMap map(kSize, kHalfLength_px, kAmbiguity_px);
  std::vector<Strip> line;
  for (int i = 0; i < 10; ++i) line.push_back({80, 20 + 5.0F * static_cast<float>(i), 1, 0, 2});
  map.claim(line);
  for (std::size_t i = 1; i + 1 < line.size(); ++i) EXPECT_EQ(map.claimed()[i], 5 * 5);
}

TEST(StripMap, CountsAreThoseOfTheOwnedPixels) {
  StripMap map(kSize, kHalfLength_px, kAmbiguity_px);
  const auto strips = random_strips(300, 7);
  for (int call = 0; call < 3; ++call) {
    map.claim(strips);
    std::vector<std::int32_t> counted(strips.size());
    for (int y = 0; y < kSize.height; ++y)
      for (int x = 0; x < kSize.width; ++x)
        if (map.owner(x, y) >= 0) ++counted[static_cast<std::size_t>(map.owner(x, y))];
    for (std::size_t i = 0; i < strips.size(); ++i) EXPECT_EQ(map.claimed()[i], counted[i]);
  }
}

TEST(StripMap, EarlierCallsAreForgottenEvenWhenTheirNumberComesAgain) {
  StripMap map(kSize, kHalfLength_px, kAmbiguity_px);
  const Strip s{80, 60, 1, 0, 2}, elsewhere{20, 20, 1, 0, 2};
  map.claim({&s, 1});
  for (int i = 0; i < 0x8000 + 3; ++i) {  // more calls than there are numbers
    map.claim({&elsewhere, 1});
    ASSERT_EQ(map.owner(80, 60), -1) << i;
  }
  map.claim({});
  EXPECT_EQ(map.owner(20, 20), -1);
}

}  // namespace
}  // namespace evpose
