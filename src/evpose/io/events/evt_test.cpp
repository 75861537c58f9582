// SPDX-License-Identifier: BSD-3-Clause
// The words of Prophesee's cameras.
#include <gtest/gtest.h>

#include <random>

#include "evpose/io/events/evt2.h"
#include "evpose/io/events/evt3.h"
#include "evpose/io/events/evt3_encoder.h"

namespace evpose {
namespace {

struct Row {
  std::int64_t t_us;
  int x, y, on;
  bool operator==(const Row&) const = default;
};

using Words = std::vector<std::uint16_t>;

Words high(unsigned v) { return {static_cast<std::uint16_t>(0x8000 | v)}; }
Words low(unsigned v) { return {static_cast<std::uint16_t>(0x6000 | v)}; }
Words row(unsigned y) { return {static_cast<std::uint16_t>(y)}; }
Words event(unsigned x, unsigned on) { return {static_cast<std::uint16_t>(0x2000 | on << 11 | x)}; }

Words join(std::initializer_list<Words> parts) {
  Words all;
  for (const Words& part : parts) all.insert(all.end(), part.begin(), part.end());
  return all;
}

/// Feeds the bytes in pieces of a length, and empties the block in between.
std::vector<Row> decode(Evt3Decoder& decoder, const Words& words, std::size_t piece = SIZE_MAX,
                        std::vector<Trigger>* triggers = nullptr) {
  const auto bytes = std::as_bytes(std::span(words));
  std::vector<Row> rows;
  EventBlock block;
  std::vector<std::byte> rest;
  for (std::size_t at = 0; at < bytes.size();) {
    const std::size_t count = std::min(piece, bytes.size() - at);
    rest.insert(rest.end(), bytes.begin() + static_cast<std::ptrdiff_t>(at),
                bytes.begin() + static_cast<std::ptrdiff_t>(at + count));
    at += count;
    while (true) {
      block.start();
      const std::size_t used = decoder.decode(rest, block, triggers);
      rest.erase(rest.begin(), rest.begin() + static_cast<std::ptrdiff_t>(used));
      for (std::size_t i = 0; i < block.count; ++i) {
        const Event& e = block.events[i];
        rows.push_back({block.time_us(i), e.x, e.y, e.on});
      }
      if (used == 0) break;
    }
  }
  return rows;
}

std::vector<Row> decode(const Words& words, ImageSize size = {}) {
  Evt3Decoder decoder(size);
  return decode(decoder, words);
}

TEST(Evt3, NothingBeforeTheTimeIsKnown) {
  const Words lost = join({row(1), event(2, 1), low(7), event(3, 1), high(5), event(4, 0)});
  EXPECT_TRUE(decode(lost).empty());
  EXPECT_EQ(decode(join({lost, low(9), event(5, 1)})), (std::vector<Row>{{5 * 4096 + 9, 5, 1, 1}}));
}

TEST(Evt3, VectorsGoOnWhereTheLastEnded) {
  const Words words =
      join({high(1), low(0), row(20), {0x3000 | 1 << 11 | 100}, {0x4801}, {0x4002}, {0x5F80}});
  EXPECT_EQ(
      decode(words),
      (std::vector<Row>{{4096, 100, 20, 1}, {4096, 111, 20, 1}, {4096, 113, 20, 1}, {4096, 131, 20, 1}}));
}

TEST(Evt3, ClockOf24BitsGoesOnAfterItsEnd) {
  const auto rows = decode(join({high(4095), low(4095), row(0), event(1, 0), high(0), low(1), event(2, 0),
                                 high(4095), low(3), event(3, 0), high(0), low(4), event(4, 0)}));
  ASSERT_EQ(rows.size(), 4u);
  EXPECT_EQ(rows[0].t_us, (1 << 24) - 1);
  EXPECT_EQ(rows[1].t_us, (1 << 24) + 1);
  EXPECT_EQ(rows[2].t_us, (1 << 24) + 1);  // a hiccup back over the end: held, no second wrap
  EXPECT_EQ(rows[3].t_us, (1 << 24) + 4);
}

TEST(Evt3, TimeThatGoesBackIsHeldAndCounted) {
  Evt3Decoder decoder;
  const auto rows =
      decode(decoder, join({high(100), low(50), row(0), event(1, 0), low(40), event(2, 0), high(98),
                            event(3, 0), high(50), event(4, 0), high(100), low(60), event(5, 0)}));
  ASSERT_EQ(rows.size(), 5u);
  for (std::size_t i = 0; i < 4; ++i) EXPECT_EQ(rows[i].t_us, 100 * 4096 + 50) << i;
  EXPECT_EQ(rows[4].t_us, 100 * 4096 + 60);
  EXPECT_EQ(decoder.faults().time_regressions, 3);
  EXPECT_EQ(decoder.faults().discontinuities, 1);
  EXPECT_EQ(decoder.faults().missing_time_high, 1);
}

TEST(Evt3, EventsOutsideOfTheImageAreDroppedAndCounted) {
  Evt3Decoder decoder({100, 50});
  const auto rows = decode(decoder, join({high(0),
                                          low(0),
                                          row(50),
                                          event(1, 0),
                                          row(49),
                                          event(100, 0),
                                          event(99, 1),
                                          {0x3000 | 98},
                                          {0x400F}}));
  EXPECT_EQ(rows, (std::vector<Row>{{0, 99, 49, 1}, {0, 98, 49, 0}, {0, 99, 49, 0}}));
  EXPECT_EQ(decoder.faults().outside, 4);
}

TEST(Evt3, WhatIsEncodedIsDecoded) {
  std::mt19937 random(5);
  std::vector<Row> rows;
  Words words;
  Evt3Encoder encoder;
  std::int64_t base_us = 3000;
  for (int packet = 0; packet < 40; ++packet) {
    std::vector<Event> events;
    for (std::uint32_t t_us = 0; events.size() < 50;
         t_us += random() % 4 == 0 ? static_cast<std::uint32_t>(random() % 3000) : 0) {
      events.push_back(make_event(t_us, static_cast<int>(random() % 1280), static_cast<int>(random() % 5),
                                  random() % 2 == 0));
      const Event& e = events.back();
      rows.push_back({base_us + t_us, e.x, e.y, e.on});
    }
    encoder.encode(events, base_us, words);
    base_us += events.back().dt_us + (packet == 20 ? 9'000'000 : 100);  // a pause of more than half the clock
  }
  ASSERT_GT(base_us, 1 << 23);
  EXPECT_EQ(decode(words, {1280, 720}), rows);
}

TEST(Evt3, TriggersAndOtherWords) {
  Evt3Decoder decoder;
  std::vector<Trigger> triggers;
  const auto rows = decode(decoder,
                           join({high(2),
                                 low(5),
                                 {0xA601},
                                 {0xE014, 0xF123, 0xF456, 0x7001},
                                 {0x1000},
                                 row(3),
                                 event(4, 1),
                                 {0xA600}}),
                           SIZE_MAX, &triggers);
  EXPECT_EQ(rows.size(), 1u);
  ASSERT_EQ(triggers.size(), 2u);
  EXPECT_EQ(triggers[0].t, (2 * 4096 + 5) * kNsPerUs);
  EXPECT_TRUE(triggers[0].on);
  EXPECT_FALSE(triggers[1].on);
  EXPECT_EQ(triggers[0].id, 6);
  EXPECT_EQ(decoder.faults().skipped_words, 1);
}

TEST(Evt3, AnyWordsInPiecesOfAnyLengthGiveTheSame) {
  std::mt19937 random(3);
  Words words = join({high(0), low(0)});
  for (int i = 0; i < 60'000; ++i) words.push_back(static_cast<std::uint16_t>(random()));
  Evt3Decoder whole;
  std::vector<Trigger> triggers;
  const auto expected = decode(whole, words, SIZE_MAX, &triggers);
  EXPECT_GT(expected.size(), 20'000u);
  for (std::size_t i = 1; i < expected.size(); ++i) EXPECT_LE(expected[i - 1].t_us, expected[i].t_us);
  for (const std::size_t piece : {1001u, 4096u, 7u}) {
    Evt3Decoder decoder;
    std::vector<Trigger> same;
    EXPECT_TRUE(decode(decoder, words, piece, &same) == expected) << piece;
    EXPECT_EQ(same.size(), triggers.size());
    EXPECT_EQ(decoder.faults().time_regressions, whole.faults().time_regressions);
  }
}

TEST(Evt3, VectorsAreAsManySingleEvents) {
  for (const ImageSize size : {ImageSize{}, ImageSize{107, 40}}) {  // the second cuts some of them off
    Words vectors = join({high(3), low(1), row(20)}), singles = vectors;
    for (unsigned mask = 0; mask < 4096; ++mask) {
      const unsigned on = mask % 2, length = mask % 3 == 0 ? 8 : 12;
      vectors = join({vectors, low(mask), {static_cast<std::uint16_t>(0x3000 | on << 11 | 100)}});
      vectors.push_back(static_cast<std::uint16_t>((length == 8 ? 0x5000 : 0x4000) | mask));
      singles = join({singles, low(mask)});
      for (unsigned k = 0; k < length; ++k)
        if ((mask >> k & 1) != 0) singles = join({singles, event(100 + k, on)});
    }
    Evt3Decoder a(size), b(size);
    const auto rows = decode(a, vectors);
    EXPECT_GT(rows.size(), size == ImageSize{} ? 20'000u : 10'000u);
    EXPECT_TRUE(rows == decode(b, singles));
    EXPECT_EQ(a.faults().outside, b.faults().outside);
  }
}

/// Said as simply as can be: a word after the other, time never goes back, wraps left out.
std::vector<Row> evt2_rows(const std::vector<std::uint32_t>& words, ImageSize size) {
  std::vector<Row> rows;
  std::int64_t high = -1, last = 0;
  for (const std::uint32_t word : words) {
    const int x = static_cast<int>(word >> 11 & 0x7FF), y = static_cast<int>(word & 0x7FF);
    if (word >> 28 == 8) high = static_cast<std::int64_t>(word & 0xFFFFFFF) << 6;
    if (word >> 28 > 1 || high < 0 || x >= size.width || y >= size.height) continue;
    last = std::max(last, high + static_cast<std::int64_t>(word >> 22 & 63));
    rows.push_back({last, x, y, static_cast<int>(word >> 28)});
  }
  return rows;
}

TEST(Evt2, FastAndInPiecesItIsWhatTheWordsSay) {
  std::mt19937 random(2);
  const auto below = [&random](unsigned n) { return static_cast<unsigned>(random() % n); };
  for (const unsigned faults_in_1000 : {0u, 5u, 300u}) {
    std::vector<std::uint32_t> words = {5, 0x80000010};  // the first comes before the time is known
    unsigned low = 0, high = 0x10;
    while (words.size() < 60'000) {
      const bool faulty = below(1000) < faults_in_1000;
      low += below(4) == 0 ? below(3) : 0;
      if (low > 63) words.push_back(0x80000000 | (high += low >> 6)), low &= 63;
      if (faulty && below(4) == 0) words.push_back(0x80000000 | (high -= below(2)));
      const unsigned x = below(faulty ? 700 : 640), y = below(faulty ? 500 : 480);
      const unsigned kind = faulty && below(4) == 0 ? 0xA : below(2);
      words.push_back(kind << 28 | (faulty ? below(64) : low) << 22 | x << 11 | y);
    }
    const auto expected = evt2_rows(words, {640, 480});
    const auto bytes = std::as_bytes(std::span(words));
    for (const std::size_t piece : {bytes.size(), std::size_t{4096}, std::size_t{44}}) {
      Evt2Decoder decoder({640, 480});
      EventBlock block;
      std::vector<Row> rows;
      for (std::size_t at = 0; at < bytes.size();) {
        block.start();
        at += decoder.decode(bytes.subspan(at, std::min(piece, bytes.size() - at)), block);
        for (std::size_t i = 0; i < block.count; ++i) {
          const Event& e = block.events[i];
          rows.push_back({block.time_us(i), e.x, e.y, e.on});
        }
      }
      EXPECT_TRUE(rows == expected) << faults_in_1000 << " " << piece;
      EXPECT_EQ(decoder.faults().outside > 0, faults_in_1000 > 0);
    }
  }
}

}  // namespace
}  // namespace evpose
