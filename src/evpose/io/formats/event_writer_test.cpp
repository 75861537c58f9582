// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/formats/create_event_writer.h"
#include "evpose/io/formats/open_events.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "evpose/io/files/test_files.h"

namespace evpose {
namespace {

struct Row {
  TimeNs t;
  int x, y;
  bool on;
  bool operator==(const Row&) const = default;
};

constexpr ImageSize kSize = {640, 480};

/// Single events, rows of neighbours at one time, pauses of all lengths.
std::vector<Row> some_events(TimeNs begin, int count) {
  std::mt19937 random(5);
  const auto below = [&](int n) { return static_cast<int>(random() % static_cast<unsigned>(n)); };
  std::vector<Row> rows;
  std::int64_t t_us = begin / kNsPerUs;
  while (static_cast<int>(rows.size()) < count) {
    const int kind = below(100);
    t_us += kind < 60 ? below(3) : kind < 98 ? below(5000) : below(20'000'000);
    const int y = below(kSize.height), x = below(kSize.width), step = 1 + below(4),
              many = below(4) == 0 ? below(30) : 1;
    const bool on = below(2) == 1;
    for (int i = 0; i < many; ++i)
      if (x + step * i < kSize.width) rows.push_back({t_us * kNsPerUs, x + step * i, y, on});
  }
  return rows;
}

Status write(const std::string& path, const std::vector<Row>& rows, std::size_t length) {
  auto writer = create_event_writer(path, "", kSize);
  if (!writer) return writer.error();
  for (std::size_t begin = 0; begin < rows.size();) {
    EventPacket packet;
    packet.base = rows[begin].t;
    for (; begin < rows.size() && packet.events.size() < length; ++begin) {
      if (rows[begin].t - packet.base > kNsPerUs * UINT32_MAX) break;
      packet.events.push_back(make_event(static_cast<std::uint32_t>((rows[begin].t - packet.base) / kNsPerUs),
                                         rows[begin].x, rows[begin].y, rows[begin].on));
    }
    if (auto status = (*writer)->append(packet); !status) return status;
  }
  return (*writer)->finish();
}

std::vector<Row> read(const std::string& path) {
  const auto reader = open_events(path, "", {});
  EXPECT_TRUE(reader.ok()) << error_line(reader);
  std::vector<Row> rows;
  if (!reader) return rows;
  EventPacket packet;
  while (true) {
    const auto more = (*reader)->next(packet);
    EXPECT_TRUE(more.ok()) << error_line(more);
    if (!more || !*more) return rows;
    for (const Event& e : packet.events) rows.push_back({packet.time(e), e.x, e.y, e.on != 0});
  }
}

class Written : public ::testing::TestWithParam<const char*> {};

TEST_P(Written, EventsReadBackExactlyFromPacketsOfAnyLength) {
  const TemporaryFolder folder;
  const std::string name = GetParam();
  const auto rows = some_events(kNsPerS * 40, 30'000);
  ASSERT_TRUE(write(folder / ("a" + name), rows, 1000).ok());
  EXPECT_TRUE(read(folder / ("a" + name)) == rows);
  ASSERT_TRUE(write(folder / ("b" + name), rows, 37).ok());
  EXPECT_TRUE(read(folder / ("b" + name)) == rows);
  ASSERT_TRUE(write(folder / ("c" + name), rows, 1000).ok());
  EXPECT_TRUE(content_of(folder / ("a" + name)) == content_of(folder / ("c" + name)));
}

TEST_P(Written, NothingStandsThereBeforeFinish) {
  const TemporaryFolder folder;
  {
    auto writer = create_event_writer(folder / ("a" + std::string(GetParam())), "", kSize);
    ASSERT_TRUE(writer.ok());
    EventPacket packet;
    packet.events.push_back(make_event(0, 1, 2, true));
    EXPECT_TRUE((*writer)->append(packet).ok());
  }
  EXPECT_EQ(folder.entries(), 0u);
}

INSTANTIATE_TEST_SUITE_P(Formats, Written, ::testing::Values(".h5", ".raw", ".txt", ".csv"),
                         [](const auto& format) { return std::string(format.param + 1); });

TEST(EventWriterRaw, LongPausesAndLateBeginningsKeepTheirTime) {
  const TemporaryFolder folder;
  std::vector<Row> rows;
  for (const std::int64_t s : {0, 1, 5, 9, 18, 60, 61, 100, 1000, 4000, 9000, 17'179})
    rows.push_back({s * kNsPerS + 17 * kNsPerUs, 3, 4, true});
  for (std::size_t first = 0; first < rows.size(); ++first) {
    const std::vector<Row> tail(rows.begin() + static_cast<std::ptrdiff_t>(first), rows.end());
    ASSERT_TRUE(write(folder / "a.raw", tail, 3).ok());
    EXPECT_TRUE(read(folder / "a.raw") == tail) << first;
  }
}

TEST(EventWriterRaw, WhatItCannotCarryIsAnError) {
  const TemporaryFolder folder;
  EXPECT_TRUE(
      says(error_line(write(folder / "a.raw", {{-1000, 1, 1, true}}, 1)), {"a.raw", "-1000 ns", "offset"}));
  EXPECT_TRUE(
      says(error_line(write(folder / "a.raw", {{17'180 * kNsPerS, 1, 1, true}}, 1)), {"cannot carry"}));
  EXPECT_TRUE(says(error_line(create_event_writer(folder / "a.raw", "", {4000, 3000})), {"4000 x 3000"}));
  EXPECT_EQ(folder.entries(), 0u);
}

TEST(EventWriter, ErrorsNameThePath) {
  const TemporaryFolder folder;
  EXPECT_TRUE(says(error_line(create_event_writer(folder / "a.xyz", "", kSize)), {"a.xyz", "extension"}));
  EXPECT_TRUE(says(error_line(create_event_writer(folder / "a.h5", "gif", kSize)), {"a.h5", "'gif'"}));
  EXPECT_TRUE(says(error_line(create_event_writer(folder / "a.h5", "", {})), {"a.h5", "size"}));
  EXPECT_TRUE(
      says(error_line(create_event_writer(folder / "none/a.raw", "", kSize)), {"none/a.raw", "folder"}));
}

}  // namespace
}  // namespace evpose
