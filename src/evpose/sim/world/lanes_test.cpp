// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/world/lanes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "evpose/sim/world/random.h"
#include "evpose/sim/world/texture.h"

namespace evpose::sim {
namespace {

TEST(Lanes, LogarithmIsWithinItsBound) {
  for (double log = std::log(1e-4); log < std::log(1e6); log += 1e-4) {
    const auto v = static_cast<float>(std::exp(log));
    const double exact = std::log(static_cast<double>(v));
    // Half a unit in the last place of the result comes on top.
    ASSERT_NEAR(static_cast<double>(fast_log(v)), exact, 1e-7 + 6e-8 * std::abs(exact)) << v;
  }
  EXPECT_EQ(fast_log(1.0F), 0);
}

TEST(Lanes, ExponentialIsWithinItsBound) {
  for (double x = -80; x < 80; x += 0.003) {
    const auto v = static_cast<float>(x);
    const double exact = std::exp(static_cast<double>(v));
    ASSERT_NEAR(static_cast<double>(fast_exp(v)) / exact, 1, 3e-7) << v;
  }
}

TEST(Lanes, ALaneHasTheBitsOfASingleNumber) {
  Random random(3);
  for (int trial = 0; trial < 1000; ++trial) {
    FloatLanes v;
    for (int i = 0; i < kLanes; ++i) v[i] = static_cast<float>(std::exp(random.uniform(-9, 13)));
    const FloatLanes log = fast_log(v), exp = fast_exp(FloatLanes(-log)), sqrt = root(v),
                     down = round_down(FloatLanes(v - 3.0F));
    for (int i = 0; i < kLanes; ++i) {
      const float one = v[i];
      ASSERT_EQ(bits(static_cast<float>(log[i])), bits(fast_log(one)));
      ASSERT_EQ(bits(static_cast<float>(exp[i])), bits(fast_exp(-fast_log(one))));
      ASSERT_EQ(bits(static_cast<float>(sqrt[i])), bits(std::sqrt(one)));
      ASSERT_EQ(static_cast<float>(down[i]), std::floor(one - 3.0F));
    }
  }
}

// Footprints from far below a texel to the whole rectangle, slanted any way, near and far from the origin.
TEST(Texture, EightPlacesAtOnceAreEightTimesOne) {
  const Texture texture(0.77, 0.5, 0.004, [](double u, double v) {
    return 0.5 + 0.25 * std::sin(90 * u + 20 * v) + 0.2 * std::cos(41 * v);
  });
  Random random(4);
  for (int trial = 0; trial < 3000; ++trial) {
    Texture::Footprint<FloatLanes> all_places;
    std::array<Texture::Footprint<float>, kLanes> places;
    for (int i = 0; i < kLanes; ++i) {
      const auto any = [&](double most) { return static_cast<float>(random.uniform(-most, most)); };
      const double size = std::exp(random.uniform(-8, 0));
      Texture::Footprint<float>& p = places[i];
      p = {any(5), any(5), any(size), any(size), any(size), any(size)};
      all_places.u[i] = p.u, all_places.v[i] = p.v;
      all_places.a_u[i] = p.a_u, all_places.a_v[i] = p.a_v;
      all_places.b_u[i] = p.b_u, all_places.b_v[i] = p.b_v;
    }
    const FloatLanes together = texture.mean(all_places);
    for (int i = 0; i < kLanes; ++i) {
      ASSERT_EQ(static_cast<float>(together[i]), texture.mean(places[i])) << trial << " " << i;
      ASSERT_GE(static_cast<float>(together[i]), 0);
      ASSERT_LE(static_cast<float>(together[i]), 1);
    }
  }
}

}  // namespace
}  // namespace evpose::sim
