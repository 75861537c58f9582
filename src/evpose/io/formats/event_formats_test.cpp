// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <thread>

#include "evpose/io/events/events_h5.h"
#include "evpose/io/files/test_files.h"
#include "evpose/io/formats/open_events.h"
#include "evpose/io/hdf5/hdf5_file.h"

namespace evpose {
namespace {

struct Row {
  TimeNs t;
  int x, y;
  bool on;
  bool operator==(const Row&) const = default;
};

/// What a reader gives; empty with `error` set when it fails.
struct Stream {
  std::vector<Row> rows;
  std::size_t packets = 0;
  std::string error;
};

Stream read_all(Expected<std::unique_ptr<EventReader>> reader) {
  Stream s;
  if (!reader) {
    s.error = reader.error().line();
    return s;
  }
  EventPacket packet;
  while (true) {
    const auto more = (*reader)->next(packet);
    if (!more) {
      s.error = more.error().line();
      return s;
    }
    EXPECT_EQ(*more, !packet.empty());
    if (!*more) return s;
    ++s.packets;
    for (const Event& e : packet.events) s.rows.push_back({packet.time(e), e.x, e.y, e.on != 0});
  }
}

Stream read_all(const std::string& path, const EventReadOptions& options = {},
                const std::string& format = "") {
  return read_all(open_events(path, format, options));
}

/// Many events of a 32x24 sensor, some at equal times.
std::vector<Row> some_events(int count) {
  std::vector<Row> rows;
  std::uint32_t seed = 7;
  TimeNs t = 1'000'000;
  for (int i = 0; i < count; ++i) {
    seed = seed * 1664525 + 1013904223;
    t += kNsPerUs * (seed >> 28 < 8 ? 0 : seed >> 26);
    rows.push_back(
        {t, static_cast<int>(seed >> 8 & 31), static_cast<int>((seed >> 13) % 24), (seed >> 20 & 1) != 0});
  }
  return rows;
}

EventPacket packet_of(const std::vector<Row>& rows, std::size_t begin, std::size_t end) {
  EventPacket packet;
  packet.base = rows[begin].t;
  for (std::size_t i = begin; i < end; ++i)
    packet.events.push_back(make_event(static_cast<std::uint32_t>((rows[i].t - packet.base) / kNsPerUs),
                                       rows[i].x, rows[i].y, rows[i].on));
  return packet;
}

void write_h5(const std::string& path, const std::vector<Row>& rows) {
  auto writer = EventWriterH5::create(path, {32, 24}, "test");
  ASSERT_TRUE(writer.ok());
  for (std::size_t i = 0; i < rows.size(); i += 1000)
    ASSERT_TRUE(writer->append(packet_of(rows, i, std::min(rows.size(), i + 1000))).ok());
  ASSERT_TRUE(writer->finish().ok());
}

template <class T>
void put(Hdf5File& file, const std::string& name, NumberType type, const std::vector<T>& values) {
  const auto dataset = file.make_dataset(name, type, {values.size()}, 4);
  ASSERT_TRUE(dataset.ok());
  ASSERT_TRUE(file.append(*dataset, type, 0, values.size(), values.data()).ok());
}

/// A small file in any shape: stamps of type T, and the rest.
template <class T>
std::string h5_file(const TemporaryFolder& folder, NumberType type, const std::vector<T>& t,
                    const std::vector<std::int16_t>& x, const std::vector<std::int8_t>& p,
                    const std::string& group = "/events") {
  std::string path = folder / "small.h5";
  auto temporary = TemporaryFile::create(path);
  auto file = Hdf5File::create(*temporary);
  EXPECT_TRUE(file->make_group(group).ok());
  put(*file, group + "/t", type, t);
  put(*file, group + "/x", NumberType::i16, x);
  put(*file, group + "/y", NumberType::i16, std::vector<std::int16_t>(t.size(), 5));
  put(*file, group + "/p", NumberType::i8, p);
  EXPECT_TRUE(file->close().ok());
  EXPECT_TRUE(temporary->commit().ok());
  return path;
}

TEST(EventsH5, WrittenEventsReadBackInPacketsOfAnyLength) {
  const TemporaryFolder folder;
  const auto rows = some_events(150'000);
  write_h5(folder / "events.h5", rows);
  for (const double packet_s : {1e-5, 1e-3, 1e-2, 100.0}) {
    EventReadOptions options;
    options.packet_s = packet_s;
    const Stream s = read_all(folder / "events.h5", options);
    EXPECT_EQ(s.error, "");
    EXPECT_TRUE(s.rows == rows) << packet_s;
  }
  const auto reader = open_events(folder / "events.h5", "", {});
  EXPECT_EQ((*reader)->size(), (ImageSize{32, 24}));
  EXPECT_EQ((*reader)->extent().first_ns, rows.front().t);
  EXPECT_EQ((*reader)->extent().last_ns, rows.back().t);
  EXPECT_EQ((*reader)->extent().count, 150'000);
}

TEST(EventsH5, NothingStandsThereBeforeFinish) {
  const TemporaryFolder folder;
  {
    auto writer = EventWriterH5::create(folder / "events.h5", {32, 24}, "test");
    ASSERT_TRUE(writer.ok());
    const auto rows = some_events(10);
    ASSERT_TRUE(writer->append(packet_of(rows, 0, rows.size())).ok());
  }
  EXPECT_EQ(folder.entries(), 0u);
}

TEST(EventsH5, SameEventsSameBytes) {
  const TemporaryFolder folder;
  write_h5(folder / "a.h5", some_events(5000));
  std::this_thread::sleep_for(std::chrono::milliseconds(1100));  // HDF5 would note the second
  write_h5(folder / "b.h5", some_events(5000));
  EXPECT_TRUE(content_of(folder / "a.h5") == content_of(folder / "b.h5"));
}

TEST(EventsH5, PacketsEndAtMultiplesAndNeverBetweenEqualStamps) {
  const TemporaryFolder folder;
  write_h5(folder / "events.h5", some_events(20'000));
  EventReadOptions options;
  options.packet_s = 1e-3;
  auto reader = open_events(folder / "events.h5", "", options);
  EventPacket packet;
  TimeNs last = 0;
  while ((*reader)->next(packet).value()) {
    const TimeNs first = packet.time(packet.events.front());
    EXPECT_GT(first, last);
    last = packet.time(packet.events.back());
    EXPECT_EQ(first / kNsPerMs, last / kNsPerMs);
    EXPECT_EQ(packet.events.front().dt_us, 0u);
  }
}

TEST(EventsH5, OffsetCropFlipsAndPolarity) {
  const TemporaryFolder folder;
  const auto rows = some_events(2000);
  write_h5(folder / "events.h5", rows);
  EventReadOptions options;
  options.offset_ns = -12'345;
  options.t_start_ns = rows[500].t - 12'345;
  options.t_end_ns = rows[1500].t - 12'345;
  options.flip_x = options.flip_y = options.swap_polarity = true;
  std::vector<Row> expected;
  for (const Row& r : rows)
    if (r.t >= rows[500].t && r.t < rows[1500].t)
      expected.push_back({r.t - 12'345, 31 - r.x, 23 - r.y, !r.on});
  const Stream s = read_all(folder / "events.h5", options);
  EXPECT_EQ(s.error, "");
  EXPECT_TRUE(s.rows == expected);
}

TEST(EventsH5, OtherTypesOffsetsAndGroups) {
  const TemporaryFolder folder;
  const std::vector<std::int16_t> x = {1, 2, 3};
  const std::vector<std::int8_t> p = {-1, 1, -1};
  const std::vector<Row> expected = {{10'000, 1, 5, false}, {20'000, 2, 5, true}, {30'000, 3, 5, false}};
  EXPECT_TRUE(read_all(h5_file<std::uint32_t>(folder, NumberType::u32, {10, 20, 30}, x, p)).rows == expected);
  EXPECT_TRUE(read_all(h5_file<std::uint32_t>(folder, NumberType::u32, {10, 20, 30}, x, p, "/raw")).rows ==
              expected);
  EventReadOptions options;
  options.time_unit = "s";
  EXPECT_TRUE(read_all(h5_file<double>(folder, NumberType::f64, {10e-6, 20e-6, 30e-6}, x, p), options).rows ==
              expected);
  options.time_unit = "ns";
  EXPECT_TRUE(
      read_all(h5_file<std::int64_t>(folder, NumberType::i64, {10'000, 20'999, 30'000}, x, p), options)
          .rows == expected);
}

TEST(EventsH5, ErrorsSayWhatWhereAndWhatToDo) {
  const TemporaryFolder folder;
  const std::vector<std::int16_t> x = {1, 2, 3};
  const std::vector<std::int8_t> p = {0, 1, 0};
  const auto i64 = [&](const std::vector<std::int64_t>& t, const std::vector<std::int16_t>& xs,
                       const std::vector<std::int8_t>& ps) {
    EventReadOptions options;
    options.size = {32, 24};
    return read_all(h5_file<std::int64_t>(folder, NumberType::i64, t, xs, ps), options).error;
  };
  EXPECT_EQ(i64({1, 2, 3}, x, p), "");
  EXPECT_TRUE(says(i64({1, 3, 2}, x, p), {"small.h5", "event 2 ", "2 us", "3 us", "out of order"}));
  EXPECT_TRUE(says(i64({1, 2, 3}, {1, 32, 3}, p), {"event 1 ", "(32, 5)", "32 x 24"}));
  EXPECT_TRUE(says(i64({1, 2, 3}, {1, -1, 3}, p), {"event 1 ", "(-1, 5)"}));
  EXPECT_TRUE(says(i64({1, 2, 3}, x, {0, 1, 2}), {"event 2 ", "polarity 2"}));
  EXPECT_TRUE(says(i64({1, 2, 3}, x, {0, 1, -1}), {"event 2 ", "0 and -1"}));
  EXPECT_TRUE(says(i64({}, {}, {}), {"small.h5", "no events"}));
  EXPECT_TRUE(says(i64({1, 2, 3}, {1, 2}, p), {"/events/x has 2 rows, /events/t has 3"}));
  EXPECT_TRUE(says(i64({1, 2, 9'000'000'000'000'000'000}, x, p), {"events.time_unit"}));
  EXPECT_TRUE(says(read_all(h5_file<double>(folder, NumberType::f64, {0.1, 0.2, 0.3}, x, p)).error,
                   {"/events/t", "seconds", "events.time_unit: s"}));
  const std::vector<std::int64_t> whole_seconds(20'000, 3);
  EXPECT_TRUE(says(read_all(h5_file<std::int64_t>(folder, NumberType::i64, whole_seconds,
                                                  std::vector<std::int16_t>(20'000, 1),
                                                  std::vector<std::int8_t>(20'000, 1)))
                       .error,
                   {"seconds", "events.time_unit: s"}));
  EXPECT_TRUE(says(read_all(folder / "none.h5").error, {"none.h5", "no such file"}));
  EXPECT_TRUE(says(read_all(folder.file("empty.h5", "")).error, {"empty"}));
  EXPECT_TRUE(says(read_all(folder.file("text.h5", "1 2 3 0\n")).error, {"not an HDF5 file"}));
  EXPECT_TRUE(says(read_all(folder.file("a.raw", "x"), {}, "raw").error, {"a.raw", "header of a RAW file"}));
  EXPECT_TRUE(says(read_all(folder.file("a.raw", "x"), {}, "row").error, {"'row'", "one of h5, "}));
  EventReadOptions flip;
  flip.flip_x = true;
  EXPECT_TRUE(says(read_all(h5_file<std::int64_t>(folder, NumberType::i64, {1, 2, 3}, x, p), flip).error,
                   {"events.resolution"}));
}

TEST(EventsH5, TruncationAnywhereIsAnsweredInOneLine) {
  const TemporaryFolder folder;
  const std::string small = h5_file<std::int64_t>(folder, NumberType::i64, {1, 2, 3}, {1, 2, 3}, {0, 1, 0});
  for (std::size_t n = std::filesystem::file_size(small); n-- > 0;) {
    std::filesystem::resize_file(small, n);
    const Stream s = read_all(small);
    EXPECT_TRUE(says(s.error, {"small.h5"})) << n;
    EXPECT_EQ(s.error.find('\n'), std::string::npos);
  }
}

TEST(EventsText, ColumnsAndUnitsAreFound) {
  const TemporaryFolder folder;
  const std::vector<Row> expected = {{1'500'000, 3, 4, true}, {1'501'000, 5, 6, false}};
  for (const char* content :
       {"0.0015 3 4 1\n0.001501 5 6 0\n", "# comment\n1500 3 4 1\r\n1501 5 6 0", "1500,3,4,1\n1501,5,6,-1\n",
        "3,4,1,1500\n5,6,0,1501\n", "%geometry:640,480\n3,4,1,1500\n5,6,0,1501\n",
        "1.5e-3 3 4 1\n1.501e-3 5 6 0\n", "t,x,y,p\n1500,3.0,4.0,1\n1501,5.0,6.0,0\n"}) {
    const Stream s = read_all(folder.file("events.txt", content));
    EXPECT_EQ(s.error, "") << content;
    EXPECT_TRUE(s.rows == expected) << content;
  }
  EventReadOptions options;
  options.time_unit = "ns";
  EXPECT_TRUE(read_all(folder.file("events.txt", "1500000 3 4 1\n1501999 5 6 0\n"), options).rows ==
              expected);
  const auto reader =
      open_events(folder.file("a.csv", "%geometry:640,480\n3,4,1,1500\n5,6,0,1501\n"), "", {});
  EXPECT_EQ((*reader)->size(), (ImageSize{640, 480}));
  EXPECT_EQ((*reader)->extent().last_ns, 1'501'000);
}

TEST(EventsText, ManyEventsInOrder) {
  const TemporaryFolder folder;
  const auto rows = some_events(50'000);
  std::string content;
  for (const Row& r : rows) content += text(r.t / kNsPerUs, " ", r.x, " ", r.y, " ", r.on, "\n");
  const Stream s = read_all(folder.file("events.txt", content));
  EXPECT_EQ(s.error, "");
  EXPECT_TRUE(s.rows == rows);
}

TEST(EventsText, ErrorsNameTheLine) {
  const TemporaryFolder folder;
  const auto error = [&](const std::string& content) {
    EventReadOptions options;
    options.size = {32, 24};
    return read_all(folder.file("events.txt", content), options).error;
  };
  std::string many;
  for (int i = 0; i < 2000; ++i) many += text(1000 + i, " 3 4 1\n");
  EXPECT_TRUE(says(error(""), {"no events"}));
  EXPECT_TRUE(says(error("1 2 3\n"), {"events.txt:1", "3 values instead of 4"}));
  EXPECT_TRUE(says(error("1 2 3 4\n2 3 4 5\n"), {"polarities"}));
  EXPECT_TRUE(says(error("# c\n10 3 4 1\n9 3 4 1\n"), {"events.txt:3", "9 us", "10 us", "out of order"}));
  EXPECT_TRUE(says(error("10 3 24 1\n"), {"events.txt:1", "(3, 24)", "32 x 24"}));
  EXPECT_TRUE(says(error(many + "4000 3 4\n"), {"events.txt:2001", "3 values"}));
  EXPECT_TRUE(says(error(many + "4000 3 4 7\n"), {"events.txt:2001", "polarity 7"}));
  EXPECT_TRUE(says(error(many + "4000 3.5 4 1\n"), {"events.txt:2001", "3.5"}));
  EXPECT_TRUE(says(error(many + "4x 3 4 1\n"), {"events.txt:2001", "4x"}));
  EXPECT_TRUE(says(error("1700000000000000000 3 4 1\n"), {"events.time_unit"}));
}

TEST(EventsText, TruncationAnywhereIsAnswered) {
  const TemporaryFolder folder;
  const std::string whole = "%geometry:32,24\n3,4,1,1500\n5,6,0,1501\n7,8,0,1502\n";
  for (std::size_t n = 0; n < whole.size(); ++n) {
    const Stream s = read_all(folder.file("cut.csv", whole.substr(0, n)));
    EXPECT_TRUE(!s.rows.empty() || says(s.error, {"cut.csv"})) << n;
  }
}

TEST(EventsText, TheCommonWayOfWritingMeansWhatEveryOtherMeans) {
  const TemporaryFolder folder;
  // Each line but the first in one way, and the same with blanks doubled, which only the general way reads.
  const std::vector<std::string> times = {"0.000001",    "0.5",   "0.50000099",   "1.",
                                          "2.000000000", "12.25", "1000000000.1", "1000000001.000001999999"};
  std::string plain, other;
  for (std::size_t i = 0; i < times.size(); ++i) {
    const std::string number = std::to_string(100 * i + i);
    plain += times[i] + " " + number + " 7 " + (i % 2 == 0 ? "1\n" : "0\n");
    other += "  " + times[i] + "  " + number + "\t7.0 " + (i % 2 == 0 ? "1.0 \r\n" : "0.0 \r\n");
  }
  const Stream a = read_all(folder.file("a.txt", plain)), b = read_all(folder.file("b.txt", other));
  EXPECT_EQ(a.error, "");
  EXPECT_EQ(b.error, "");
  EXPECT_TRUE(a.rows == b.rows);
  ASSERT_EQ(a.rows.size(), times.size());
  EXPECT_EQ(a.rows[2].t, 500'000'000);
  EXPECT_EQ(a.rows.back(), (Row{1'000'000'001'000'001'000, 707, 7, false}));
}

TEST(Events, SharedRecordingsHaveTheKnownCounts) {
  const std::string data = shared_folder() + "/data/";
  EVPOSE_NEEDS_SHARED(data);
  const std::pair<const char*, std::int64_t> counts[] = {
      {"peer/room_hover/events.h5", 1'628'487},
      {"peer/room_720p/events.h5", 2'503'337},
      {"real/mvsec_indoor_flying1_chunk/events.h5", 37'187}};
  for (const auto& [name, count] : counts) {
    auto reader = open_events(data + name, "", {});
    ASSERT_TRUE(reader.ok()) << error_line(reader);
    std::int64_t events = 0;
    EventPacket packet;
    while ((*reader)->next(packet).value()) events += static_cast<std::int64_t>(packet.events.size());
    EXPECT_EQ(events, count) << name;
    EXPECT_EQ((*reader)->extent().count, count) << name;
  }
}

TEST(Events, SimpleRawEventsHaveTheKnownRows) {
  const std::string folder = shared_folder() + "/data/real/formats/";
  EVPOSE_NEEDS_SHARED(folder);
  const Stream from_text = read_all(folder + "simple_raw_events.txt");
  EXPECT_EQ(from_text.error, "");
  ASSERT_EQ(from_text.rows.size(), 17u);
  EXPECT_EQ(from_text.rows[1], (Row{779'000, 158, 59, false}));
  EXPECT_EQ(from_text.rows[16], (Row{5'748'000, 181, 74, false}));
  EXPECT_TRUE(says(read_all(folder + "simple_raw_events.hdf5").error, {"seconds", "events.time_unit: s"}));
  EventReadOptions seconds;
  seconds.time_unit = "s";
  const Stream from_h5 = read_all(folder + "simple_raw_events.hdf5", seconds);
  EXPECT_EQ(from_h5.error, "");
  ASSERT_EQ(from_h5.rows.size(), 17u);
  EXPECT_EQ(from_h5.rows[16], (Row{5'748'000, 74, 181, false}));
}

}  // namespace
}  // namespace evpose
