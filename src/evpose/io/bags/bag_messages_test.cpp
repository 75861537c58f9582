// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/bags/bag_messages.h"

#include <gtest/gtest.h>

#include <array>

#include "evpose/io/bags/event_messages.h"
#include "evpose/io/bags/message_writer.h"
#include "evpose/io/files/test_files.h"

namespace evpose {
namespace {

BagTopic topic(const std::string& type, Wire wire) { return {"/t", type, wire, "", 1}; }

MessageWriter with_header(Wire wire, TimeNs stamp) {
  MessageWriter out(wire);
  if (wire == Wire::ros1) out.u32(41);
  out.time(stamp);
  out.string("frame");
  return out;
}

BagMessage message_of(const MessageWriter& writer) { return {0, 0, writer.data()}; }

std::vector<std::byte> bytes(std::initializer_list<int> values) {
  std::vector<std::byte> out;
  for (const int value : values) out.push_back(static_cast<std::byte>(value));
  return out;
}

class Wires : public ::testing::TestWithParam<Wire> {};

TEST_P(Wires, FieldsComeBackAsWritten) {
  MessageWriter writer(GetParam());
  writer.u8(1);
  writer.u16(0x2345);
  writer.u8(3);
  writer.f64(-1.5);
  writer.string("abc");
  writer.u64(0x123456789ABCDEF0);
  writer.u8(9);
  writer.time(5'000'000'007);
  writer.byte_sequence("xyz");
  MessageReader reader(writer.data(), GetParam());
  EXPECT_EQ(reader.u8(), 1);
  EXPECT_EQ(reader.u16(), 0x2345);
  EXPECT_EQ(reader.u8(), 3);
  EXPECT_EQ(reader.f64(), -1.5);
  EXPECT_EQ(reader.string(), "abc");
  EXPECT_EQ(reader.u64(), 0x123456789ABCDEF0);
  EXPECT_EQ(reader.u8(), 9);
  EXPECT_EQ(reader.time(), 5'000'000'007);
  EXPECT_EQ(reader.byte_sequence().size(), 3u);
  EXPECT_TRUE(reader.ok());
  EXPECT_EQ(reader.left(), 0u);
  reader.u8();
  EXPECT_FALSE(reader.ok());
  for (std::size_t n = 0; n < writer.size(); ++n) {
    MessageReader cut(writer.data().first(n), GetParam());
    cut.u8(), cut.u16(), cut.u8(), cut.f64(), cut.string(), cut.u64(), cut.u8(), cut.time(),
        cut.byte_sequence();
    EXPECT_FALSE(cut.ok()) << n;
  }
}

TEST_P(Wires, PosesOfAllTypesAreThatOfTheirFields) {
  for (const char* type : {"geometry_msgs/PoseStamped", "geometry_msgs/PoseWithCovarianceStamped",
                           "geometry_msgs/TransformStamped", "nav_msgs/Odometry"}) {
    MessageWriter writer = with_header(GetParam(), 12'000'000'034);
    const std::string name = type;
    if (name.ends_with("TransformStamped") || name.ends_with("Odometry")) writer.string("child_");
    writer.numbers(std::array<double, 7>{1, 2, 3, 0.6, 0, 0, 0.8});
    if (name.ends_with("CovarianceStamped") || name.ends_with("Odometry"))
      writer.numbers(std::array<double, 36>{});
    if (name.ends_with("Odometry")) writer.numbers(std::array<double, 42>{});
    const auto pose = parse_pose(topic(type, GetParam()), message_of(writer), "here");
    ASSERT_TRUE(pose.ok()) << error_line(pose);
    EXPECT_EQ(pose->t, 12'000'000'034);
    EXPECT_EQ(pose->pose.p, Eigen::Vector3d(1, 2, 3));
    EXPECT_NEAR(pose->pose.q.x(), 0.6, 1e-15);
    EXPECT_NEAR(pose->pose.q.w(), 0.8, 1e-15);
  }
}

TEST_P(Wires, APoseWithoutRotationIsRefused) {
  MessageWriter writer = with_header(GetParam(), 0);
  writer.numbers(std::array<double, 7>{1, 2, 3, 0, 0, 0, 0});
  EXPECT_TRUE(
      says(error_line(parse_pose(topic("geometry_msgs/PoseStamped", GetParam()), message_of(writer), "here")),
           {"here", "no pose"}));
}

struct Image {
  const char* encoding;
  bool big_endian;
  std::vector<int> row;       ///< of two pixels
  std::vector<int> expected;  ///< values handed over
};

TEST_P(Wires, ImagesOfEachEncoding) {
  const Image images[] = {{"mono8", false, {10, 20}, {10, 20}},
                          {"rgb8", false, {1, 2, 3, 4, 5, 6}, {1, 2, 3, 4, 5, 6}},
                          {"bgr8", false, {1, 2, 3, 4, 5, 6}, {3, 2, 1, 6, 5, 4}},
                          {"bgra8", false, {1, 2, 3, 255, 4, 5, 6, 255}, {3, 2, 1, 6, 5, 4}},
                          {"mono16", false, {1, 200, 2, 100}, {200, 100}},
                          {"mono16", true, {200, 1, 100, 2}, {200, 100}}};
  for (const Image& image : images) {
    MessageWriter writer = with_header(GetParam(), 5);
    writer.u32(2), writer.u32(2);
    writer.string(image.encoding);
    writer.u8(image.big_endian ? 1 : 0);
    writer.u32(static_cast<std::uint32_t>(image.row.size() + 3));  // rows have padding
    std::string data;
    for (int row = 0; row < 2; ++row) {
      for (const int value : image.row) data += static_cast<char>(value);
      data += "pad";
    }
    writer.byte_sequence(data);
    const auto frame = parse_image(topic("sensor_msgs/Image", GetParam()), message_of(writer), "here");
    ASSERT_TRUE(frame.ok()) << error_line(frame);
    EXPECT_EQ(frame->t, 5);
    EXPECT_EQ(frame->channels, static_cast<int>(image.expected.size() / 2));
    std::vector<int> twice = image.expected;
    twice.insert(twice.end(), image.expected.begin(), image.expected.end());
    EXPECT_EQ(std::vector<int>(frame->pixels.begin(), frame->pixels.end()), twice) << image.encoding;
  }
}

INSTANTIATE_TEST_SUITE_P(All, Wires, ::testing::Values(Wire::ros1, Wire::cdr),
                         [](const auto& wire) { return wire.param == Wire::ros1 ? "Ros1" : "Cdr"; });

TEST(Cdr, BigEndianAndPlainXcdr2) {
  const auto big = bytes({0, 0, 0, 0, 0xAA, 0, 0, 0, 0x12, 0x34, 0x56, 0x78, 0, 0, 0, 3, 'h', 'i', 0});
  MessageReader reader(big, Wire::cdr);
  EXPECT_EQ(reader.u8(), 0xAA);
  EXPECT_EQ(reader.u32(), 0x12345678u);
  EXPECT_EQ(reader.string(), "hi");
  EXPECT_TRUE(reader.ok());
  // Eight bytes are aligned to four there.
  const auto xcdr2 = bytes({0, 7, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0, 0, 0, 0, 0});
  MessageReader second(xcdr2, Wire::cdr);
  EXPECT_EQ(second.u8(), 1);
  EXPECT_EQ(second.u64(), 2u);
  EXPECT_TRUE(second.ok());
  EXPECT_FALSE(MessageReader(bytes({0, 3, 0, 0, 1}), Wire::cdr).ok());  // parameter lists
}

/// An array whose events are aligned, in the other byte order, against its bytes written out by hand.
TEST(EventArray, BigEndianCdr) {
  const auto data = bytes({0, 0, 0, 0,                                           // head
                           0, 0, 0, 1,  0, 0, 0, 0,                              // stamp
                           0, 0, 0, 1,  0, 0, 0, 0,                              // frame_id "", padding
                           0, 0, 0, 48, 0, 0, 0, 64,                             // height, width
                           0, 0, 0, 2,                                           // events
                           0, 5, 0, 6,  0, 0, 0, 2,  0, 0, 0x0F, 0xA0, 1,    0,  // (5, 6) at 2 s + 4 us
                           0, 7, 0, 8,  0, 0, 0, 0,  0, 3, 0,    0,    0x17, 0x70, 0});
  const BagTopic t = topic("dvs_msgs/EventArray", Wire::cdr);
  const auto parsed = parse_event_message(t, {0, 0, data}, "here");
  ASSERT_TRUE(parsed.ok()) << error_line(parsed);
  EXPECT_EQ(parsed->size, (ImageSize{64, 48}));
  EventMessageDecoder decoder;
  decoder.begin(*parsed, "here");
  EventBlock block;
  block.start();
  const auto all = decoder.decode(block);
  ASSERT_TRUE(all.ok()) << error_line(all);
  EXPECT_TRUE(*all);
  ASSERT_EQ(block.count, 2u);
  EXPECT_EQ(block.time_us(0), 2'000'004);
  EXPECT_EQ(block.events[0].x, 5);
  EXPECT_EQ(block.events[0].on, 1);
  EXPECT_EQ(block.time_us(1), 3'000'006);
  EXPECT_EQ(block.events[1].y, 8);
  EXPECT_EQ(block.events[1].on, 0);
}

/// Words of libcaer_cmp: a column's rows as a mask, in the byte order that the message says.
TEST(EventPacket, LibcaerVectorsRunAlongColumns) {
  for (const bool big_endian : {false, true}) {
    std::string words;
    for (const int word : {0x0001, 0x1002, 0x2005, 0x4810, 0x5005, 0x5081, 0x3007}) {
      const char low = static_cast<char>(word & 0xFF), high = static_cast<char>(word >> 8);
      words += big_endian ? std::string{high, low} : std::string{low, high};
    }
    MessageWriter writer = with_header(Wire::ros1, 0);
    writer.u32(260), writer.u32(346);
    writer.u64(0);
    writer.u64(7'000'000'000);
    writer.string("libcaer_cmp");
    writer.u8(big_endian ? 1 : 0);
    writer.byte_sequence(words);
    const auto parsed =
        parse_event_message(topic("event_camera_msgs/EventPacket", Wire::ros1), message_of(writer), "here");
    ASSERT_TRUE(parsed.ok()) << error_line(parsed);
    EventMessageDecoder decoder;
    decoder.begin(*parsed, "here");
    EventBlock block;
    block.start();
    ASSERT_TRUE(decoder.decode(block).value());
    std::vector<int> rows;
    for (std::size_t i = 0; i < block.count; ++i) {
      EXPECT_EQ(block.time_us(i), 7'000'000 + 4096 + 2);
      EXPECT_EQ(block.events[i].x, 5);
      EXPECT_EQ(block.events[i].on, i < 4 ? 1 : 0);
      rows.push_back(block.events[i].y);
    }
    EXPECT_EQ(rows, (std::vector<int>{16, 18, 24, 31, 7}));
  }
}

TEST(EventPacket, AnUnknownEncodingIsNamed) {
  MessageWriter writer = with_header(Wire::cdr, 0);
  writer.u32(1), writer.u32(1);
  writer.u64(0), writer.u64(0);
  writer.string("evt9");
  writer.u8(0);
  writer.byte_sequence("");
  EXPECT_TRUE(says(error_line(parse_event_message(topic("event_camera_msgs/EventPacket", Wire::cdr),
                                                  message_of(writer), "here")),
                   {"here", "'evt9'"}));
}

TEST(Definition, AChangedOneIsRefusedWithBothSums) {
  BagTopic changed = topic("sensor_msgs/Imu", Wire::ros1);
  changed.md5 = "00000000000000000000000000000000";
  EXPECT_TRUE(says(error_line(check_definition(changed, "a.bag")),
                   {"a.bag", "00000000000000000000000000000000", "6a62c6daae103f4ff57a132d6f95cec2"}));
  changed.md5 = "*";
  EXPECT_TRUE(check_definition(changed, "a.bag").ok());
}

}  // namespace
}  // namespace evpose
