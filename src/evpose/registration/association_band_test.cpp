// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/association_band.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

namespace evpose {
namespace {

constexpr ImageSize kSize{160, 120};
constexpr float kHalfLength_px = 4, kAmbiguity_px = 1, kSpan_us = 5000;

struct Place {
  float x, y, age_us;
};

class Random {
 public:
  explicit Random(unsigned seed) : random_(seed) {}
  float in(float low, float high) { return low + (high - low) * u_(random_); }
  AssociationBand band() {
    const float a = in(0, 6.28F);
    return {in(-10, 170),      in(-10, 130),      std::cos(a), std::sin(a),
            in(-2e-3F, 2e-3F), in(-2e-8F, 2e-8F), in(0.5F, 6)};
  }
  Place place() { return {in(0, 159), in(0, 119), in(0, kSpan_us)}; }

 private:
  std::mt19937 random_;
  std::uniform_real_distribution<float> u_{0, 1};
};

AssociationIndex index_of(std::span<const AssociationBand> bands) {
  AssociationIndex index(kSize, kHalfLength_px, kAmbiguity_px);
  index.build(bands, kSpan_us);
  return index;
}

float distance(const AssociationBand& s, const Place& p) {
  return s.nx * (p.x - s.x) + s.ny * (p.y - s.y) + s.speed * p.age_us - s.curvature * p.age_us * p.age_us;
}
float along(const AssociationBand& s, const Place& p) {
  return std::abs(s.nx * (p.y - s.y) - s.ny * (p.x - s.x));
}
bool covers(const AssociationBand& s, const Place& p) {
  return std::abs(distance(s, p)) <= s.reach && along(s, p) <= kHalfLength_px;
}
/// So near to a band's border that rounding decides.
bool on_border(const AssociationBand& s, const Place& p) {
  return std::abs(std::abs(distance(s, p)) - s.reach) < 1e-2F ||
         std::abs(along(s, p) - kHalfLength_px) < 1e-2F;
}

TEST(AssociationIndex, ABandOwnsWhatItCoversAtTheEventsTime) {
  Random random(1);
  int covered = 0;
  for (int i = 0; i < 300; ++i) {
    const AssociationBand s = random.band();
    const AssociationIndex index = index_of({&s, 1});
    for (int k = 0; k < 300; ++k) {
      Place p = random.place();
      if (k % 2 == 0) {  // near the band, as few of the others are
        p.x = std::clamp(s.x + random.in(-12, 12), 0.0F, 159.0F);
        p.y = std::clamp(s.y + random.in(-12, 12), 0.0F, 119.0F);
      }
      if (on_border(s, p)) continue;
      const auto owner = index.find(p.x, p.y, p.age_us);
      ASSERT_EQ(owner.band == 0, covers(s, p)) << p.x << ' ' << p.y << ' ' << p.age_us;
      if (owner.band != 0) continue;
      EXPECT_NEAR(owner.distance, distance(s, p), 1e-3);
      ++covered;
    }
  }
  EXPECT_GT(covered, 1000);
}

/// Two bands of different lines: the definition, place by place.
TEST(AssociationIndex, BetweenTwoLinesTheNearerOwnsUnlessBothAreAsNear) {
  Random random(2);
  int nobody = 0;
  for (int i = 0; i < 200; ++i) {
    std::array<AssociationBand, 2> pair{random.band(), random.band()};
    pair[0].x = 80, pair[0].y = 60, pair[1].x = 83, pair[1].y = 58;
    if (std::abs(pair[0].nx * pair[1].nx + pair[0].ny * pair[1].ny) > 0.97F) continue;
    const AssociationIndex index = index_of(pair);
    for (int k = 0; k < 500; ++k) {
      const Place p{random.in(65, 95), random.in(45, 75), random.in(0, kSpan_us)};
      if (on_border(pair[0], p) || on_border(pair[1], p)) continue;
      const bool a = covers(pair[0], p), b = covers(pair[1], p);
      const float nearer_by = std::abs(distance(pair[1], p)) - std::abs(distance(pair[0], p));
      if (std::abs(std::abs(nearer_by) - kAmbiguity_px) < 1e-2F) continue;
      int expected = a ? 0 : b ? 1 : -1;
      if (a && b) expected = std::abs(nearer_by) < kAmbiguity_px ? -1 : nearer_by > 0 ? 0 : 1;
      ASSERT_EQ(index.find(p.x, p.y, p.age_us).band, expected) << i << ": " << p.x << ' ' << p.y;
      nobody += a && b && expected == -1;
    }
  }
  EXPECT_GT(nobody, 100);
}

TEST(AssociationIndex, NeighboursOfOneLineShareItEvenly) {
  std::vector<AssociationBand> line;
  for (int i = 0; i < 10; ++i) line.push_back({80, 20 + 5.0F * static_cast<float>(i), 1, 0, 1e-4F, 0, 2});
  const AssociationIndex index = index_of(line);
  for (float y = 18; y < 67; y += 0.37F)
    EXPECT_EQ(index.find(80.5F, y, 1000).band, static_cast<int>(std::lround((y - 20) / 5))) << y;
}

/// What is found does not depend on the order of the bands.
TEST(AssociationIndex, OrderOfTheBandsDoesNotMatter) {
  Random random(3);
  std::vector<AssociationBand> bands;
  for (int i = 0; i < 300; ++i) bands.push_back(random.band());
  const std::vector<AssociationBand> reversed(bands.rbegin(), bands.rend());
  const AssociationIndex a = index_of(bands), b = index_of(reversed);
  int owned = 0;
  for (int k = 0; k < 20000; ++k) {
    const Place p = random.place();
    const std::int32_t i = a.find(p.x, p.y, p.age_us).band, j = b.find(p.x, p.y, p.age_us).band;
    ASSERT_EQ(i, j < 0 ? j : 299 - j);
    owned += i >= 0;
  }
  EXPECT_GT(owned, 2000);
}

/// Eight side by side find what each finds alone, but for rounding at borders.
TEST(AssociationIndex, ManyEventsFindWhatEachFindsAlone) {
  Random random(5);
  std::vector<AssociationBand> bands;
  for (int i = 0; i < 200; ++i) bands.push_back(random.band());
  AssociationIndex index = index_of(bands);
  constexpr std::uint32_t kNow_us = 3;  // the clock has just begun anew
  for (const std::size_t count : {0, 3, 8, 9, 20003}) {
    std::vector<FilteredEvent> events(count);
    for (FilteredEvent& e : events) {
      const Place p = random.place();
      e.stamp_us = kNow_us - static_cast<std::uint32_t>(p.age_us);
      e.x = static_cast<std::uint16_t>(p.x);
      e.y = static_cast<unsigned>(p.y) & 0x7fffU;
    }
    std::vector<AssociationIndex::Found> found;
    index.find_all({events.data(), count / 3}, 0, kNow_us, &found);
    index.find_all(events, count / 3, kNow_us, &found);
    std::size_t next = 0, rounded = 0;
    for (std::uint32_t k = 0; k < count; ++k) {
      const FilteredEvent& e = events[k];
      const Place p{static_cast<float>(e.x), static_cast<float>(e.y),
                    static_cast<float>(kNow_us - e.stamp_us)};
      const auto alone = index.find(p.x, p.y, p.age_us);
      const bool listed = next < found.size() && found[next].event == k;
      const auto together = listed ? found[next++].owner : AssociationIndex::Owner{};
      if (together.band == alone.band) {
        EXPECT_NEAR(together.distance, alone.distance, 1e-3);
      } else {
        ++rounded;
        EXPECT_TRUE(std::any_of(bands.begin(), bands.end(),
                                [&](const AssociationBand& s) { return on_border(s, p); }));
      }
    }
    EXPECT_EQ(next, found.size());
    EXPECT_LE(rounded, count / 1000);
    EXPECT_GE(found.size(), count / 10);
  }
}

/// Where a band owns events is marked, and no more than what is near it.
TEST(AssociationIndex, TheMapOfInterestHoldsWhatIsOwned) {
  constexpr float kMargin_px = 2, kSlack_px = kMargin_px + 1.5F * InterestMap::kCell_px;
  Random random(6);
  int owned = 0, beside = 0;
  for (int i = 0; i < 300; ++i) {
    const AssociationBand s = random.band();
    const AssociationIndex index = index_of({&s, 1});
    InterestMap interest(kSize.width, kSize.height);
    const std::uint8_t asked = 1, not_asked = 0;
    index.mark({&not_asked, 1}, kMargin_px, 0, &interest);
    ASSERT_EQ(interest.share(), 0);
    index.mark({&asked, 1}, kMargin_px, 0, &interest);
    for (std::uint32_t y = 0; y < 120; ++y)
      for (std::uint32_t x = 0; x < 160; ++x) {
        const Place p{static_cast<float>(x), static_cast<float>(y), random.in(0, kSpan_us)};
        const bool is_owned = index.find(p.x, p.y, p.age_us).band == 0;
        ASSERT_TRUE(!is_owned || interest.holds(x, y)) << x << ' ' << y;
        owned += is_owned;
        const float sway = std::abs(s.speed) * kSpan_us + 4 * std::abs(s.curvature) * kSpan_us * kSpan_us;
        if (std::abs(distance(s, p)) > s.reach + sway + kSlack_px ||
            along(s, p) > kHalfLength_px + kSlack_px) {
          ASSERT_FALSE(interest.holds(x, y)) << x << ' ' << y;
          ++beside;
        }
      }
  }
  EXPECT_GT(owned, 1000);
  EXPECT_GT(beside, 1000);
}

TEST(AssociationIndex, EarlierBandsAreForgotten) {
  const AssociationBand s{80, 60, 1, 0, 0, 0, 2}, elsewhere{20, 20, 1, 0, 0, 0, 2};
  AssociationIndex index = index_of({&s, 1});
  EXPECT_EQ(index.find(80, 60, 0).band, 0);
  index.build({&elsewhere, 1}, kSpan_us);
  EXPECT_EQ(index.find(80, 60, 0).band, -1);
  EXPECT_EQ(index.find(20, 20, 0).band, 0);
  index.build({}, kSpan_us);
  EXPECT_EQ(index.find(20, 20, 0).band, -1);
}

TEST(AssociationIndex, ATangleOfLinesBelongsToNobody) {
  Random random(4);
  std::vector<AssociationBand> bands;
  for (int i = 0; i < 100; ++i) {
    bands.push_back(random.band());
    bands.back().x = 80, bands.back().y = 60, bands.back().speed = bands.back().curvature = 0;
  }
  EXPECT_EQ(index_of(bands).find(80, 60, 0).band, -1);
}

}  // namespace
}  // namespace evpose
