// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/bags/bag_writer.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <random>

#include "evpose/io/bags/bag_container_writer.h"
#include "evpose/io/bags/bag_reader.h"
#include "evpose/io/bags/bag_streams.h"
#include "evpose/io/bags/message_definitions.h"
#include "evpose/io/files/test_files.h"

namespace evpose {
namespace {

constexpr TimeNs kStart = 1'700'000'000'000'000'000;

struct Flat {
  TimeNs t;
  int x, y;
  bool on;
  bool operator==(const Flat&) const = default;
};

std::vector<EventPacket> made_up_events(int packets) {
  std::mt19937 random(7);
  std::vector<EventPacket> out;
  std::int64_t t_us = kStart / kNsPerUs + 123;
  for (int k = 0; k < packets; ++k) {
    EventPacket packet;
    packet.base = t_us * kNsPerUs;
    for (int i = 0; i < 400; ++i) {
      t_us += random() % 7;
      packet.events.push_back(make_event(static_cast<std::uint32_t>(t_us - packet.base / kNsPerUs),
                                         static_cast<int>(random() % 640), static_cast<int>(random() % 480),
                                         random() % 2 == 1));
    }
    out.push_back(std::move(packet));
  }
  return out;
}

std::vector<Flat> flat(const std::vector<EventPacket>& packets) {
  std::vector<Flat> out;
  for (const EventPacket& packet : packets)
    for (const Event& e : packet.events) out.push_back({packet.time(e), e.x, e.y, e.on != 0});
  return out;
}

Expected<std::vector<Flat>> read_events(const std::string& path) {
  auto reader = open_events_bag(path, {});
  if (!reader) return reader.error();
  std::vector<EventPacket> packets;
  EventPacket packet;
  while (true) {
    const auto more = (*reader)->next(packet);
    if (!more) return more.error();
    if (!*more) return flat(packets);
    packets.push_back(packet);
  }
}

ImuSample imu_sample(int i) { return {kStart + i * 5'000'001LL, {0.1 * i, -0.3, 1e-9}, {i / 3.0, 2, -9.81}}; }
TimedPose timed_pose(int i) {
  return {kStart + i * 7'000'003LL, {so3::exp({0.1 * i, 0.2, -0.3}), {i / 7.0, -2, 3}}};
}

struct Sensors {
  std::vector<ImuSample> imu;
  std::vector<TimedPose> poses;
};

Expected<Sensors> read_all_sensors(const std::string& path) {
  Sensors out;
  SensorSink sink;
  sink.imu = [&](const ImuSample& s) { out.imu.push_back(s); };
  sink.pose = [&](const TimedPose& p) { out.poses.push_back(p); };
  if (auto status = read_bag_sensors(path, "", sink); !status) return status.error();
  return out;
}

struct Kind {
  const char* name;
  const char* file;
  Compression compression;
  bool packets;
};

class BagRoundTrip : public ::testing::TestWithParam<Kind> {
 protected:
  BagWriteOptions options() const {
    BagWriteOptions out;
    out.compression = GetParam().compression;
    out.event_packets = GetParam().packets;
    return out;
  }
  /// Events in packets of the given number, IMU samples and poses between them.
  void write(const std::string& path, const std::vector<EventPacket>& packets) const {
    auto writer = BagWriter::create(path, {640, 480}, options());
    ASSERT_TRUE(writer.ok()) << error_line(writer);
    for (std::size_t i = 0; i < packets.size(); ++i) {
      ASSERT_TRUE(writer->append(packets[i]).ok());
      ASSERT_TRUE(writer->append(imu_sample(static_cast<int>(i))).ok());
      ASSERT_TRUE(writer->append(timed_pose(static_cast<int>(i))).ok());
    }
    EXPECT_FALSE(std::filesystem::exists(path));
    const auto finished = writer->finish();
    ASSERT_TRUE(finished.ok()) << error_line(finished);
  }
};

TEST_P(BagRoundTrip, EverythingComesBackExactly) {
  const TemporaryFolder folder;
  const std::string path = folder / GetParam().file;
  const auto packets = made_up_events(900);  // several chunks
  write(path, packets);
  auto reader = open_events_bag(path, {});
  ASSERT_TRUE(reader.ok()) << error_line(reader);
  EXPECT_EQ((*reader)->size(), (ImageSize{640, 480}));
  const auto all = flat(packets);
  EXPECT_EQ((*reader)->extent().first_ns, all.front().t);
  EXPECT_EQ((*reader)->extent().last_ns, all.back().t);
  const auto events = read_events(path);
  ASSERT_TRUE(events.ok()) << error_line(events);
  EXPECT_TRUE(*events == all);
  const auto sensors = read_all_sensors(path);
  ASSERT_TRUE(sensors.ok()) << error_line(sensors);
  ASSERT_EQ(sensors->imu.size(), packets.size());
  ASSERT_EQ(sensors->poses.size(), packets.size());
  for (int i = 0; i < 900; ++i) {
    const auto& imu = sensors->imu[static_cast<std::size_t>(i)];
    EXPECT_EQ(imu.t, imu_sample(i).t);
    EXPECT_EQ(imu.gyro, imu_sample(i).gyro);
    EXPECT_EQ(imu.accel, imu_sample(i).accel);
    const auto& pose = sensors->poses[static_cast<std::size_t>(i)];
    EXPECT_EQ(pose.t, timed_pose(i).t);
    EXPECT_EQ(pose.pose.p, timed_pose(i).pose.p);
    EXPECT_LT(pose.pose.minus(timed_pose(i).pose).norm(), 1e-15);
  }
  const auto streams = list_bag_streams(path);
  ASSERT_TRUE(streams.ok());
  ASSERT_EQ(streams->size(), 3u);
  for (const StreamInfo& stream : *streams) {
    if (stream.kind != StreamKind::events) {
      EXPECT_EQ(stream.messages, 900) << stream.name;
    }
  }
}

TEST_P(BagRoundTrip, BytesDependOnEventsNotOnPackets) {
  const TemporaryFolder folder;
  const auto packets = made_up_events(50);
  EventPacket one{packets.front().base, {}};
  for (const EventPacket& packet : packets)
    for (const Event& e : packet.events)
      one.events.push_back(make_event(static_cast<std::uint32_t>((packet.time(e) - one.base) / kNsPerUs), e.x,
                                      e.y, e.on != 0));
  const auto bytes = [&](const std::vector<EventPacket>& given) {
    const std::string path = folder / GetParam().file;
    auto writer = BagWriter::create(path, {640, 480}, options());
    for (const EventPacket& packet : given) EXPECT_TRUE(writer->append(packet).ok());
    EXPECT_TRUE(writer->finish().ok());
    return content_of(path);
  };
  EXPECT_TRUE(bytes(packets) == bytes({one}));
}

TEST_P(BagRoundTrip, CutAnywhereIsAnErrorOrABeginning) {
  const TemporaryFolder folder;
  const std::string path = folder / GetParam().file;
  const auto packets = made_up_events(6);
  write(path, packets);
  const auto all = flat(packets);
  const std::string whole = content_of(path);
  for (std::size_t length = 0; length < whole.size(); length += length < 4200 ? 41 : 97) {
    const std::string cut = folder.file("cut", std::string_view(whole).substr(0, length));
    const auto events = read_events(cut);
    expect_no_harm(events, cut, length);
    if (!events) continue;
    ASSERT_LE(events->size(), all.size());
    EXPECT_TRUE(std::equal(events->begin(), events->end(), all.begin())) << length;
  }
}

TEST_P(BagRoundTrip, ADamagedByteNeverHarms) {
  const TemporaryFolder folder;
  const std::string path = folder / GetParam().file;
  write(path, made_up_events(2));
  const std::string whole = content_of(path);
  for (std::size_t at = 0; at < whole.size(); at += 53) {
    std::string spoilt = whole;
    spoilt[at] = static_cast<char>(spoilt[at] ^ (1 << at % 8));
    const std::string cut = folder.file("spoilt", spoilt);
    expect_no_harm(read_events(cut), cut, at);
    expect_no_harm(read_all_sensors(cut), cut, at);
  }
}

INSTANTIATE_TEST_SUITE_P(Kinds, BagRoundTrip,
                         ::testing::Values(Kind{"Ros1Plain", "a.bag", Compression::none, false},
                                           Kind{"Ros1Lz4", "a.bag", Compression::lz4, false},
                                           Kind{"Ros1Packets", "a.bag", Compression::lz4, true},
                                           Kind{"McapPlain", "a.mcap", Compression::none, false},
                                           Kind{"McapLz4", "a.mcap", Compression::lz4, false},
                                           Kind{"McapZstd", "a.mcap", Compression::zstd, false},
                                           Kind{"McapPackets", "a.mcap", Compression::zstd, true}),
                         [](const auto& kind) { return std::string(kind.param.name); });

TEST(BagWriter, StampsThatRosCannotCarryAreErrors) {
  const TemporaryFolder folder;
  auto ros1 = BagWriter::create(folder / "a.bag", {640, 480});
  auto ros2 = BagWriter::create(folder / "a.mcap", {640, 480});
  ImuSample before = imu_sample(0), late = before;
  before.t = -1;
  late.t = (std::int64_t{1} << 31) * kNsPerS;
  EXPECT_TRUE(says(error_line(ros1->append(before)), {"a.bag", "1970"}));
  EXPECT_TRUE(ros1->append(late).ok());
  EXPECT_TRUE(says(error_line(ros2->append(late)), {"a.mcap", "cannot be written"}));
}

TEST(BagWriter, WhatCannotBeWrittenIsSaid) {
  const TemporaryFolder folder;
  EXPECT_TRUE(says(error_line(BagWriter::create(folder / "a.txt", {1, 1})), {"a.txt", ".bag"}));
  BagWriteOptions options;
  options.compression = Compression::zstd;
  EXPECT_TRUE(says(error_line(BagWriter::create(folder / "a.bag", {1, 1}, options)), {"a.bag", "lz4"}));
  EXPECT_TRUE(says(error_line(BagWriter::create(folder / "none/a.bag", {1, 1})), {"none/a.bag"}));
  EXPECT_EQ(folder.entries(), 0u);
}

TEST(BagWriter, DefinitionsNameEveryPartOnce) {
  const std::string imu = message_definition("sensor_msgs/Imu", Wire::ros1);
  const auto count = [](const std::string& in, const std::string& what) {
    int n = 0;
    for (auto at = in.find(what); at != std::string::npos; at = in.find(what, at + 1)) ++n;
    return n;
  };
  EXPECT_EQ(count(imu, "MSG: "), 3);
  EXPECT_EQ(count(imu, "MSG: geometry_msgs/Vector3\n"), 1);
  EXPECT_EQ(count(imu, "uint32 seq\n"), 1);
  const std::string array = message_definition("dvs_msgs/EventArray", Wire::cdr);
  EXPECT_EQ(count(array, "MSG: "), 3);
  EXPECT_EQ(count(array, "MSG: builtin_interfaces/Time\n"), 1);
  EXPECT_EQ(count(array, "\ntime "), 0);
  EXPECT_EQ(count(array, "seq"), 0);
}

}  // namespace
}  // namespace evpose
