// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <random>
#include <thread>

#include "evpose/serve/packet_source.h"
#include "evpose/serve/packets.h"
#include "evpose/serve/session.h"

namespace evpose {
namespace {

EventPacket packet_at(TimeNs base, int count, std::uint32_t step_us = 1) {
  EventPacket out;
  out.base = base;
  for (int i = 0; i < count; ++i)
    out.events.push_back(make_event(static_cast<std::uint32_t>(i) * step_us, i % 64, i % 48, i % 2 == 0));
  return out;
}

StreamItem events_item(EventPacket packet) {
  StreamItem item;
  item.kind = StreamItem::Kind::events;
  item.events = std::move(packet);
  return item;
}

StreamItem imu_item(TimeNs t) {
  StreamItem item;
  item.kind = StreamItem::Kind::imu;
  item.imu = {{t, {0, 0, 0}, {0, 0, 9.81}}};
  return item;
}

// ---- queue ----

TEST(StreamQueue, NothingIsShedFromWhatIsTakenInTime) {
  QueueConfig config;
  config.thin_after_ms = config.drop_after_ms = 1e5;  // however busy this machine is
  StreamQueue queue(config);
  for (int i = 0; i < 100; ++i) {
    ASSERT_TRUE(queue.push(events_item(packet_at(i * kNsPerMs, 1000))));
    StreamItem item;
    ASSERT_TRUE(queue.pop(item, kNsPerS));
    EXPECT_EQ(item.events.base, i * kNsPerMs);
    EXPECT_EQ(item.events.events.size(), 1000u);
    EXPECT_EQ(item.stride, 1);
  }
  EXPECT_EQ(queue.counts().events_shed, 0u);
}

TEST(StreamQueue, IsBoundedKeepsTheNewestAndCountsTheRest) {
  QueueConfig config;
  config.most_mev = 1;
  config.thin_after_ms = config.drop_after_ms = 1e5;
  StreamQueue queue(config);
  for (int i = 0; i < 300; ++i) {
    ASSERT_TRUE(queue.push(events_item(packet_at(i, 10'000))));
    ASSERT_TRUE(queue.push(imu_item(i)));
  }
  const auto counts = queue.counts();
  EXPECT_EQ(counts.events_in, 3'000'000u);
  EXPECT_EQ(counts.events_shed, 2'000'000u);
  EXPECT_LE(counts.most_waiting, 1'000'000u);
  EXPECT_EQ(counts.imu_shed, 0u);
  StreamItem item;
  TimeNs last = -1;
  int imu = 0;
  while (queue.pop(item, 0)) {
    imu += static_cast<int>(item.imu.size());
    if (item.kind == StreamItem::Kind::events) last = item.events.base;
  }
  EXPECT_EQ(last, 299);
  EXPECT_EQ(imu, 300);
}

/// Packets each half a millisecond that wait so long.
double share_after(ShareByWait& share, int packets, TimeNs from, double waited_ms) {
  double out = 1;
  for (int i = 0; i < packets; ++i) out = share.add(from + i * kNsPerMs / 2, waited_ms);
  return out;
}

TEST(ShareByWait, AnUpdateThatPacketsWaitForTellsNothing) {
  ShareByWait share(1);
  for (int i = 0; i < 1000; ++i) EXPECT_EQ(share.add(i * kNsPerMs / 2, i % 7 == 0 ? 0.2 : 30), 1);
}

TEST(ShareByWait, FallsWhileAllWaitAndRisesAgain) {
  ShareByWait share(1);
  constexpr int kMoment = 21;  // packets
  constexpr TimeNs kLong = kMoment * kNsPerMs / 2;
  const double first = share_after(share, kMoment, 0, 1.5);
  EXPECT_NEAR(first, 1 / 1.5, 1e-9);
  const double second = share_after(share, kMoment, kLong, 100);
  EXPECT_NEAR(second, 0.5 * first, 1e-9) << "by no more than half at once";
  EXPECT_EQ(share_after(share, 10 * kMoment, 2 * kLong, 100), ShareByWait::kLeast);
  double before = ShareByWait::kLeast;
  for (int i = 0; i < 60; ++i) {
    const double now = share_after(share, kMoment, (12 + i) * kLong, 0.1);
    EXPECT_TRUE(now > before || now == 1) << i;
    before = now;
  }
  EXPECT_EQ(before, 1);
}

TEST(StreamQueue, UpdatesAreLeftOutWhereLookingAtLessDoesNotHelp) {
  QueueConfig config;
  config.thin_after_ms = 0.1;  // all of it has waited longer than this when it is taken
  config.drop_after_ms = 1e5;
  StreamQueue queue(config);
  for (int i = 0; i < 40; ++i) {
    queue.push(events_item(packet_at(i * kNsPerMs, 10)));
    std::this_thread::sleep_for(std::chrono::milliseconds(3));
  }
  std::this_thread::sleep_for(std::chrono::milliseconds(15));
  double share = 1;
  StreamItem item;
  for (int i = 0; i < 40; ++i) {
    ASSERT_TRUE(queue.pop(item, 0));
    EXPECT_LE(item.share, share);
    share = item.share;
    EXPECT_EQ(item.stride > 1, share == ShareByWait::kLeast) << i;
  }
  EXPECT_EQ(share, ShareByWait::kLeast);
  EXPECT_EQ(queue.counts().events_shed, 0u);
}

TEST(StreamQueue, WhatWaitedTooLongIsLeftOut) {
  QueueConfig config;
  config.drop_after_ms = 0.1;  // all of it has waited longer than this when it is taken
  StreamQueue queue(config);
  queue.push(events_item(packet_at(0, 10'000)));
  std::this_thread::sleep_for(std::chrono::milliseconds(5));
  StreamItem item;
  ASSERT_TRUE(queue.pop(item, 0));
  EXPECT_TRUE(item.events.events.empty());
  EXPECT_EQ(queue.counts().events_shed, 10'000u);
}

TEST(StreamQueue, WithoutSheddingTheSourceWaits) {
  QueueConfig config;
  config.shed = false;
  config.most_mev = 1;
  StreamQueue queue(config);
  std::thread source([&] {
    for (int i = 0; i < 50; ++i) ASSERT_TRUE(queue.push(events_item(packet_at(i, 100'000))));
  });
  std::size_t events = 0;
  StreamItem item;
  while (events < 5'000'000 && queue.pop(item, 20 * kNsPerS)) events += item.events.events.size();
  source.join();
  EXPECT_EQ(events, 5'000'000u);
  EXPECT_EQ(queue.counts().events_shed, 0u);
  EXPECT_LE(queue.counts().most_waiting, 1'000'000u);
  queue.close();
  EXPECT_FALSE(queue.push(imu_item(0)));
}

// ---- packets ----

const ImageSize kSize{64, 48};

std::vector<std::uint8_t> some_stream() {
  std::vector<std::uint8_t> out;
  const auto add = [&](const std::vector<std::uint8_t>& packet) {
    out.insert(out.end(), packet.begin(), packet.end());
  };
  for (std::uint32_t i = 0; i < 20; ++i) {
    add(encode_packet(packet_at(i * kNsPerMs, 40), 2 * i));
    const ImuSample sample{i * kNsPerMs, {1, 2, 3.5}, {4, 5, -6}};
    add(encode_packet(std::span(&sample, 1), 2 * i + 1));
  }
  return out;
}

void expect_whole(const std::vector<StreamItem>& items) {
  ASSERT_EQ(items.size(), 40u);
  for (std::size_t i = 0; i < 20; ++i) {
    const EventPacket sent = packet_at(static_cast<TimeNs>(i) * kNsPerMs, 40);
    ASSERT_EQ(items[2 * i].events.events.size(), 40u);
    EXPECT_EQ(items[2 * i].events.base, sent.base);
    EXPECT_EQ(std::memcmp(items[2 * i].events.events.data(), sent.events.data(), 320), 0);
    ASSERT_EQ(items[2 * i + 1].imu.size(), 1u);
    EXPECT_EQ(items[2 * i + 1].imu[0].gyro, Eigen::Vector3d(1, 2, 3.5));
    EXPECT_EQ(items[2 * i + 1].imu[0].accel, Eigen::Vector3d(4, 5, -6));
  }
}

TEST(Packets, ComeBackHoweverTheStreamIsCut) {
  const auto bytes = some_stream();
  for (const std::size_t piece : {bytes.size(), std::size_t{1}, std::size_t{1000}}) {
    PacketDecoder decoder(kSize);
    std::vector<StreamItem> items;
    for (std::size_t at = 0; at < bytes.size(); at += piece)
      decoder.stream(std::span(bytes).subspan(at, std::min(piece, bytes.size() - at)), items);
    expect_whole(items);
    EXPECT_EQ(decoder.counts().bad_packets, 0u);
    EXPECT_EQ(decoder.counts().missed, 0u);
  }
}

TEST(Packets, AStreamGoesOnAfterGarbage) {
  std::vector<std::uint8_t> bytes(100, 0x45);
  const auto good = some_stream();
  bytes.insert(bytes.end(), good.begin(), good.end());
  PacketDecoder decoder(kSize);
  std::vector<StreamItem> items;
  decoder.stream(bytes, items);
  expect_whole(items);
  EXPECT_EQ(decoder.counts().bad_packets, 1u);
  EXPECT_EQ(decoder.counts().skipped_bytes, 100u);
}

TEST(Packets, FaultsAreCountedAndLeftOut) {
  PacketDecoder decoder(kSize);
  std::vector<StreamItem> items;
  EventPacket wrong = packet_at(0, 10);
  wrong.events[3].x = 64;     // outside
  wrong.events[5].dt_us = 0;  // back in time
  decoder.datagram(encode_packet(wrong, 0), items);
  ASSERT_EQ(items.size(), 1u);
  EXPECT_EQ(items[0].events.events.size(), 8u);
  const ImuSample not_finite{0, {NAN, 0, 0}, {0, 0, 0}};
  decoder.datagram(encode_packet(std::span(&not_finite, 1), 5), items);
  EXPECT_EQ(items.size(), 1u);
  auto lie = encode_packet(packet_at(0, 10), 6);
  lie[12] = lie[13] = lie[14] = lie[15] = 0xFF;  // says it is 4 GB
  decoder.datagram(lie, items);
  decoder.stream(lie, items);
  EXPECT_EQ(items.size(), 1u);
  EXPECT_EQ(decoder.counts().bad_events, 2u);
  EXPECT_EQ(decoder.counts().bad_samples, 1u);
  EXPECT_EQ(decoder.counts().missed, 4u);
  EXPECT_EQ(decoder.counts().bad_packets, 2u);
}

TEST(Packets, Evt3RunsOnFromPacketToPacket) {
  // TIME_HIGH 1, y 6, TIME_LOW 9, x 3 on; the words of one event are cut between two packets.
  const std::vector<std::uint8_t> words{0x01, 0x80, 0x09, 0x60, 0x06, 0x00, 0x03, 0x28};
  PacketDecoder decoder(kSize);
  std::vector<StreamItem> items;
  decoder.datagram(encode_evt3_packet(std::span(words).first(4), kNsPerS, 0), items);
  EXPECT_TRUE(items.empty());
  decoder.datagram(encode_evt3_packet(std::span(words).subspan(4), kNsPerS, 1), items);
  ASSERT_EQ(items.size(), 1u);
  const EventPacket& got = items[0].events;
  EXPECT_EQ(got.time(got.events[0]), kNsPerS + (4096 + 9) * kNsPerUs);
  EXPECT_EQ(got.events[0].x, 3);
  EXPECT_EQ(got.events[0].y, 6);
  EXPECT_EQ(got.events[0].on, 1);
}

TEST(PacketSource, TakesDatagramsAndNamesWhatIsWrongWithAnAddress) {
  std::unique_ptr<Source> source;
  int port = 25550;
  std::string address;
  for (; port < 25650 && !source; ++port) {
    address = "udp://127.0.0.1:" + std::to_string(port);
    if (auto opened = open_packet_source(address, kSize)) source = std::move(*opened);
  }
  ASSERT_TRUE(source);
  EXPECT_EQ(open_packet_source(address, kSize).error().what, "the port is in use");
  EXPECT_FALSE(open_packet_source("udp://127.0.0.1", kSize));
  EXPECT_FALSE(open_packet_source("tcp://:1", kSize));
  StreamQueue queue({});
  std::thread thread([&] { source->run(queue); });
  const int sender = ::socket(AF_INET, SOCK_DGRAM, 0);
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(static_cast<std::uint16_t>(port - 1));
  to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  const auto bytes = encode_packet(packet_at(7, 5), 0);
  ::sendto(sender, bytes.data(), bytes.size(), 0, reinterpret_cast<const sockaddr*>(&to), sizeof to);
  ::close(sender);
  StreamItem item;
  EXPECT_TRUE(queue.pop(item, 20 * kNsPerS));
  EXPECT_EQ(item.events.base, 7);
  queue.close();
  thread.join();
}

// ---- session ----

/// A session over a tracker that stands before a wall, and what it says.
class SessionStory : public testing::Test {
 protected:
  SessionStory() {
    auto map = std::make_shared<ContourMap>();
    for (int i = -50; i < 50; ++i) {
      ContourPoint p;
      p.position = {0.02f * static_cast<float>(i), 0, 3};
      p.tangent = {1, 0, 0};
      p.normal = {0, 1, 0};
      p.length = 0.02f;
      map->points.push_back(p);
    }
    CameraIntrinsics camera;
    camera.size = kSize;
    camera.fx = camera.fy = 60;
    camera.cx = 31.5, camera.cy = 23.5;
    camera.distortion_model = "none";
    setup_.camera = *make_camera(camera);
    setup_.map = map;
  }

  Session session(std::optional<TimeNs> start_at = std::nullopt) {
    SessionConfig config;
    config.search.on = false;
    return {config,
            true,
            TrackerStart{},
            start_at,
            [this](const TrackerStart& start) {
              starts_.push_back(start.state);
              sigma_m_.push_back(start.position_sigma_m);
              return make_tracker(setup_, {}, start);
            },
            {[this](const Update& u, TimeNs offset, const Tracker&) {
               updates_.push_back(u.t);
               offset_ = offset;
             },
             [this](const std::string& why) { restarts_.push_back(why); },
             [this](const std::string& what) { stalls_.push_back(what); },
             [this](const std::string& words) { notices_.push_back(words); }}};
  }

  /// A millisecond of both streams; the wall clock is the data's and a second.
  void feed(Session& s, TimeNs from, TimeNs until, bool events = true, bool imu = true) {
    for (TimeNs t = from; t < until; t += kNsPerMs) {
      const TimeNs now = t + kNsPerMs + kNsPerS;
      if (imu) {
        StreamItem item = imu_item(t);
        s.take(item, now);
      }
      if (events) {
        StreamItem item = events_item(packet_at(t, 100, 9));
        item.arrived_ns = now;
        s.take(item, now);
      }
      s.tick(now);
    }
  }

  TrackerSetup setup_;
  std::vector<StartState> starts_;
  std::vector<double> sigma_m_;
  std::vector<TimeNs> updates_;
  std::vector<std::string> restarts_, stalls_, notices_;
  TimeNs offset_ = 0;
};

TEST_F(SessionStory, StartsWithTheDataAndUpdatesAtItsRate) {
  Session s = session();
  feed(s, 5 * kNsPerS, 6 * kNsPerS);
  EXPECT_EQ(starts_.size(), 1u);
  EXPECT_EQ(starts_[0].t, 5 * kNsPerS);
  EXPECT_NEAR(static_cast<double>(updates_.size()), 299, 1);
  EXPECT_TRUE(restarts_.empty() && stalls_.empty() && notices_.empty());
  // The newest event of a packet is 891 us after its base, and comes when the packet ends.
  EXPECT_EQ(offset_, kNsPerS + 109 * kNsPerUs);
}

TEST_F(SessionStory, AClockThatGoesBackStartsAnew) {
  Session s = session();
  feed(s, 5 * kNsPerS, 6 * kNsPerS);
  updates_.clear();
  feed(s, 5 * kNsPerS, 6 * kNsPerS);
  ASSERT_EQ(restarts_.size(), 1u);
  EXPECT_NE(restarts_[0].find("went back by"), std::string::npos);
  EXPECT_NEAR(static_cast<double>(updates_.size()), 299, 2);
}

TEST_F(SessionStory, EventsThatStopAreNamedAndSurvived) {
  Session s = session();
  feed(s, 0, kNsPerS);
  feed(s, kNsPerS, 6 * kNsPerS, false, true);
  EXPECT_EQ(stalls_, std::vector<std::string>{"no events for 0.3 s"});
  updates_.clear();
  feed(s, 6 * kNsPerS, 7 * kNsPerS);
  EXPECT_EQ(restarts_.size(), 1u);
  EXPECT_NEAR(static_cast<double>(updates_.size()), 299, 2);
}

TEST_F(SessionStory, WithoutEventsForAWhileTheImuCarriesThePose) {
  Session s = session();
  feed(s, 0, kNsPerS);
  feed(s, kNsPerS, 2 * kNsPerS, false, true);
  feed(s, 2 * kNsPerS, 3 * kNsPerS);
  EXPECT_TRUE(restarts_.empty());
  EXPECT_EQ(starts_.size(), 1u);
  EXPECT_NEAR(static_cast<double>(updates_.size()), 899, 1);
}

TEST_F(SessionStory, WithoutTheFirstEventsItStillStartsWhereAndWhenItWasTold) {
  Session s = session(2 * kNsPerMs);
  feed(s, 0, kNsPerS, false, true);
  feed(s, kNsPerS, 2 * kNsPerS);
  EXPECT_TRUE(restarts_.empty());
  ASSERT_EQ(starts_.size(), 1u);
  EXPECT_EQ(starts_[0].t, 2 * kNsPerMs);
  EXPECT_NEAR(static_cast<double>(updates_.size()), 599, 1) << "the IMU's samples were kept";
}

TEST_F(SessionStory, WhenBothStoppedItStartsAnew) {
  Session s = session();
  feed(s, 0, kNsPerS);
  feed(s, 2 * kNsPerS, 3 * kNsPerS);
  EXPECT_EQ(restarts_.size(), 1u);
}

TEST_F(SessionStory, AnImuThatStopsIsNamedAndSurvivedAndEventsAreShed) {
  Session s = session();
  feed(s, 0, kNsPerS);
  const auto before = s.counts().events_shed;
  feed(s, kNsPerS, 3 * kNsPerS, true, false);
  EXPECT_EQ(stalls_, std::vector<std::string>{"no IMU for 0.3 s"});
  EXPECT_NEAR(static_cast<double>(s.counts().events_shed - before), 190'000, 1000)
      << "all but the first 0.1 s";
  updates_.clear();
  feed(s, 3 * kNsPerS, 4 * kNsPerS);
  EXPECT_EQ(restarts_.size(), 1u);
  EXPECT_NEAR(static_cast<double>(updates_.size()), 298, 3);
}

TEST_F(SessionStory, UpdatesThatCannotBeMadeInTimeAreLeftOutEvenly) {
  Session s = session();
  for (TimeNs t = 0; t < kNsPerS; t += kNsPerMs) {
    StreamItem sample = imu_item(t), item = events_item(packet_at(t, 100, 9));
    s.take(sample, t);
    item.stride = 3;
    s.take(item, t);
  }
  ASSERT_NEAR(static_cast<double>(updates_.size()), 100, 1);
  for (std::size_t i = 2; i < updates_.size(); ++i)
    EXPECT_NEAR(static_cast<double>(updates_[i] - updates_[i - 1]), 1e7, 2);
}

TEST_F(SessionStory, ResetGoesBackToTheStartPose) {
  Session s = session(2 * kNsPerMs);
  feed(s, 0, kNsPerS);
  s.reset("asked for");
  feed(s, 0, kNsPerS);
  ASSERT_EQ(starts_.size(), 2u);
  EXPECT_EQ(starts_[1].t, 2 * kNsPerMs);
  EXPECT_EQ(sigma_m_[1], 0) << "as well known as at first";
  EXPECT_EQ(s.counts().restarts, 1u);
}

TEST_F(SessionStory, LateEventsAreCountedNotTracked) {
  Session s = session();
  feed(s, 0, kNsPerS);
  StreamItem late = events_item(packet_at(kNsPerS - 5 * kNsPerMs, 100, 1));
  s.take(late, 2 * kNsPerS);
  EXPECT_EQ(s.counts().events_late, 100u);
  EXPECT_TRUE(restarts_.empty());
}

}  // namespace
}  // namespace evpose
