// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <fcntl.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <random>
#include <string>

#include "evpose/mavlink/link.h"
#include "evpose/mavlink/link_check.h"
#include "evpose/mavlink/reporter.h"

namespace evpose::mavlink {
namespace {

std::vector<std::uint8_t> from_hex(const std::string& hex) {
  std::vector<std::uint8_t> out;
  for (std::size_t i = 0; i + 1 < hex.size(); i += 3)
    out.push_back(static_cast<std::uint8_t>(std::stoi(hex.substr(i, 2), nullptr, 16)));
  return out;
}

std::vector<Frame> frames_of(Parser& parser, Bytes bytes) {
  std::vector<Frame> out;
  parser.parse(bytes, [&](const Frame& frame) { out.push_back(frame); });
  return out;
}

/// Different values in every byte of a message.
template <class Message>
Message filled(std::uint8_t from) {
  Message m;
  Message::fields(m, [&](auto&... field) {
    const auto fill = [&](auto& f) {
      auto* bytes = reinterpret_cast<std::uint8_t*>(&f);
      for (std::size_t i = 0; i < sizeof f; ++i) bytes[i] = static_cast<std::uint8_t>(1 + from++ % 100);
    };
    (fill(field), ...);
  });
  return m;
}

template <class Message>
std::vector<std::uint8_t> bytes_of(const Message& m) {
  std::vector<std::uint8_t> out;
  Message::fields(m, [&](const auto&... field) {
    const auto take = [&](const auto& f) {
      const auto* bytes = reinterpret_cast<const std::uint8_t*>(&f);
      out.insert(out.end(), bytes, bytes + sizeof f);
    };
    (take(field), ...);
  });
  return out;
}

TEST(MavlinkCodec, ChecksumHasItsCheckValue) {
  const std::string text = "123456789";
  EXPECT_EQ(crc({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}), 0x6F91);
}

TEST(MavlinkCodec, HeartbeatIsThePublishedFrame) {
  Heartbeat m;
  m.system_status = 4;
  const FrameBytes frame = encode(m, 7, 42, 197);
  EXPECT_EQ(std::vector<std::uint8_t>(frame.bytes().begin(), frame.bytes().end()),
            from_hex("fd 09 00 00 07 2a c5 00 00 00 00 00 00 00 12 08 00 04 03 88 92 "));
}

TEST(MavlinkCodec, EveryMessageHasItsLengthAndComesBack) {
  for_each_message([](const auto& any) {
    using Message = std::decay_t<decltype(any)>;
    const Message m = filled<Message>(Message::kType.id & 63);
    EXPECT_EQ(bytes_of(m).size(), Message::kType.most) << Message::kType.name;
    Parser parser;
    const auto frames = frames_of(parser, encode(m, 1, 2, 3).bytes());
    ASSERT_EQ(frames.size(), 1u) << Message::kType.name;
    EXPECT_EQ(frames[0].sequence, 1);
    EXPECT_EQ(frames[0].system, 2);
    EXPECT_EQ(frames[0].component, 3);
    const auto back = decode<Message>(frames[0]);
    ASSERT_TRUE(back);
    EXPECT_EQ(bytes_of(*back), bytes_of(m)) << Message::kType.name;
  });
}

TEST(MavlinkCodec, ZerosAtTheEndAreNotSentAndComeBackAsZeros) {
  Odometry m = filled<Odometry>(5);
  m.quality = 0;
  const FrameBytes frame = encode(m, 0, 1, 1);
  EXPECT_EQ(frame.data[1], 232);
  Parser parser;
  const auto frames = frames_of(parser, frame.bytes());
  ASSERT_EQ(frames.size(), 1u);
  EXPECT_EQ(bytes_of(*decode<Odometry>(frames[0])), bytes_of(m));
  EXPECT_EQ(encode(SystemTime{}, 0, 1, 1).data[1], 1) << "one byte stays";
}

TEST(MavlinkCodec, NewerExtensionsAreIgnored) {
  std::vector<std::uint8_t> payload(20, 9);  // a heartbeat with eleven bytes more
  Parser parser;
  const auto frames = frames_of(parser, encode_frame(0, payload, 0, 1, 1).bytes());
  ASSERT_EQ(frames.size(), 1u);
  EXPECT_EQ(decode<Heartbeat>(frames[0])->mavlink_version, 9);
}

TEST(MavlinkCodec, Version1IsUnderstood) {
  std::vector<std::uint8_t> frame{0xFE, 9, 5, 1, 1, 0, 0, 0, 0, 0, 2, 3, 81, 4, 3};
  const std::uint8_t extra = 50;
  const std::uint16_t sum = crc({&extra, 1}, crc(Bytes(frame).subspan(1)));
  frame.push_back(static_cast<std::uint8_t>(sum)), frame.push_back(static_cast<std::uint8_t>(sum >> 8));
  Parser parser;
  const auto frames = frames_of(parser, frame);
  ASSERT_EQ(frames.size(), 1u);
  EXPECT_EQ(frames[0].version, 1);
  EXPECT_EQ(decode<Heartbeat>(frames[0])->autopilot, 3);
}

TEST(MavlinkCodec, GarbageHidesNoFrameHoweverTheStreamIsCut) {
  std::mt19937 random(3);
  std::vector<std::uint8_t> stream;
  constexpr int kFrames = 200;
  for (int i = 0; i < kFrames; ++i) {
    for (auto n = random() % 40; n > 0; --n)
      stream.push_back(random() % 4 == 0 ? 0xFD : static_cast<std::uint8_t>(random()));
    const auto frame =
        i % 2 ? encode(filled<Odometry>(static_cast<std::uint8_t>(i)), static_cast<std::uint8_t>(i), 1, 197)
              : encode(Heartbeat{}, static_cast<std::uint8_t>(i), 1, 197);
    stream.insert(stream.end(), frame.bytes().begin(), frame.bytes().end());
  }
  stream.insert(stream.end(), 300, 0);  // a false start before the last frame waits for no more than this
  for (const std::size_t piece : {stream.size(), std::size_t{1}, std::size_t{7}}) {
    Parser parser;
    int found = 0;
    for (std::size_t at = 0; at < stream.size(); at += piece)
      for (const Frame& frame :
           frames_of(parser, Bytes(stream).subspan(at, std::min(piece, stream.size() - at)))) {
        EXPECT_EQ(frame.sequence, static_cast<std::uint8_t>(found));
        ++found;
      }
    EXPECT_EQ(found, kFrames);
  }
}

TEST(MavlinkCodec, AnyDamagedByteIsNoticed) {
  const FrameBytes good = encode(filled<Timesync>(1), 9, 1, 197);
  for (std::size_t i = 0; i < good.size; ++i)
    for (int bit = 0; bit < 8; ++bit) {
      if (i == 3) continue;  // compatibility flags count for the checksum, but are not looked at
      FrameBytes bad = good;
      bad.data[i] ^= static_cast<std::uint8_t>(1 << bit);
      Parser parser;
      EXPECT_TRUE(frames_of(parser, bad.bytes()).empty()) << i << " " << bit;
    }
}

// ---- frames ----

Update moving_update() {
  Update u;
  u.t = kNsPerS;
  u.health = Health::tracking;
  u.T_map_body = {so3::exp({0.1, -0.2, 0.7}), {1, 2, 3}};
  u.velocity = {0.3, -0.4, 0.5};
  u.angular_rate = {0.2, 0.1, -0.3};
  Matrix6d A;
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 36; ++i) A(i / 6, i % 6) = 1e-3 * normal(random);
  u.covariance = A * A.transpose();
  u.velocity_covariance = 4 * u.covariance.topLeftCorner<3, 3>();
  return u;
}

VehicleFrames mounted() {
  VehicleFrames frames;
  frames.T_ned_map = ned_from_heading(0.4);
  frames.T_ned_map.p = {10, 20, 30};
  frames.T_body_vehicle = {so3::exp({0.3, 0.1, -0.5}), {0.1, -0.05, 0.2}};
  return frames;
}

TEST(MavlinkFrames, AnEnuMapIsHeadedEast) {
  EXPECT_TRUE(ned_from_heading(M_PI / 2).rotation().isApprox(rotation_ned_enu(), 1e-12));
  EXPECT_NEAR(rotation_frd_flu().determinant(), 1, 1e-12);
}

TEST(MavlinkFrames, ForwardRightDownComesOutAsOne) {
  VehicleFrames frames;
  frames.T_ned_map = ned_from_heading(M_PI / 2);  // ENU
  Update u;
  u.T_map_body.q = so3::exp({0, 0, M_PI / 2});  // forward is the map's y: north
  NedState s = to_ned(u, frames);
  EXPECT_TRUE(euler_of(s.q_ned_frd).isZero(1e-9)) << "level, headed north";
  const Pose start = u.T_map_body;
  // One metre forward, two to the right, three down, in the body's forward-left-up axes.
  u.T_map_body.p = start * Eigen::Vector3d(1, -2, -3);
  s = to_ned(u, frames);
  EXPECT_TRUE(s.position.isApprox(Eigen::Vector3d(1, 2, 3), 1e-9)) << "north, east, down";
  u.velocity = start.q * Eigen::Vector3d(4, -5, -6);
  EXPECT_TRUE(to_ned(u, frames).velocity_frd.isApprox(Eigen::Vector3d(4, 5, 6), 1e-9));
  u.angular_rate = {0.1, -0.2, -0.3};  // roll right, pitch up, yaw right
  EXPECT_TRUE(to_ned(u, frames).rates_frd.isApprox(Eigen::Vector3d(0.1, 0.2, 0.3), 1e-9));
  u.T_map_body.q = start.q * so3::exp({0.1, 0, 0});
  EXPECT_NEAR(euler_of(to_ned(u, frames).q_ned_frd).x(), 0.1, 1e-9) << "right side down is positive roll";
  u.T_map_body.q = start.q * so3::exp({0, -0.1, 0});
  EXPECT_NEAR(euler_of(to_ned(u, frames).q_ned_frd).y(), 0.1, 1e-9) << "nose up is positive pitch";
  u.T_map_body.q = start.q * so3::exp({0, 0, -0.1});
  EXPECT_NEAR(euler_of(to_ned(u, frames).q_ned_frd).z(), 0.1, 1e-9) << "to the right is positive yaw";
}

/// Moves the update by an error of the estimate's own kind.
Update disturbed(const Update& u, const Vector6d& d) {
  Update out = u;
  out.T_map_body = u.T_map_body.plus(d);
  return out;
}

TEST(MavlinkFrames, CovariancesAreThoseOfTheSentErrors) {
  const Update u = moving_update();
  const VehicleFrames frames = mounted();
  const NedState s = to_ned(u, frames);
  const RosState r = to_ros(u, frames.T_body_vehicle);
  Matrix6d J_ned, J_ros;
  constexpr double kStep = 1e-6;
  for (int i = 0; i < 6; ++i) {
    const Update v = disturbed(u, kStep * Vector6d::Unit(i));
    const NedState n = to_ned(v, frames);
    J_ned.col(i) << (n.position - s.position) / kStep,
        so3::log(s.q_ned_frd.conjugate() * n.q_ned_frd) / kStep;
    const RosState m = to_ros(v, frames.T_body_vehicle);
    J_ros.col(i) << (m.T_map_base.p - r.T_map_base.p) / kStep,
        so3::log(m.T_map_base.q * r.T_map_base.q.conjugate()) / kStep;
  }
  EXPECT_TRUE((J_ned * u.covariance * J_ned.transpose()).isApprox(s.covariance, 1e-4));
  EXPECT_TRUE((J_ros * u.covariance * J_ros.transpose()).isApprox(r.covariance, 1e-4));
}

TEST(MavlinkFrames, VelocityIsThatOfTheVehiclesOrigin) {
  const Update u = moving_update();
  const VehicleFrames frames = mounted();
  constexpr double kStep_s = 1e-6;
  Update later = u;
  later.T_map_body = {u.T_map_body.q * so3::exp(kStep_s * u.angular_rate),
                      u.T_map_body.p + kStep_s * u.velocity};
  const NedState a = to_ned(u, frames), b = to_ned(later, frames);
  EXPECT_TRUE(((b.position - a.position) / kStep_s).isApprox(a.velocity_ned, 1e-4));
  EXPECT_TRUE((so3::log(a.q_ned_frd.conjugate() * b.q_ned_frd) / kStep_s).isApprox(a.rates_frd, 1e-4));
  const RosState r = to_ros(u, frames.T_body_vehicle);
  EXPECT_TRUE((frames.T_ned_map.rotation() * r.T_map_base.rotation() * r.velocity_base)
                  .isApprox(a.velocity_ned, 1e-9));
}

// ---- reporter ----

struct Wire {
  Parser parser;
  std::vector<Frame> frames;
  Reporter::Send send() {
    return
        [this](Bytes bytes) { parser.parse(bytes, [this](const Frame& frame) { frames.push_back(frame); }); };
  }
  template <class Message>
  std::vector<Message> all() const {
    std::vector<Message> out;
    for (const Frame& frame : frames)
      if (const auto m = decode<Message>(frame)) out.push_back(*m);
    return out;
  }
};

Update at(int number, Health health = Health::tracking) {
  Update u;
  u.t = kNsPerS + from_seconds(number / 300.0);
  u.health = health;
  u.velocity = {1, 0, 0};
  u.T_map_body.p = {to_seconds(u.t), 0, 1};
  u.covariance = 1e-6 * Matrix6d::Identity();
  return u;
}

TEST(MavlinkReporter, FiftyOfThreeHundredAreEverySixth) {
  Wire wire;
  Reporter reporter({}, {}, wire.send());
  for (int i = 0; i < 3000; ++i) reporter.add(at(i), 0);
  const auto sent = wire.all<Odometry>();
  EXPECT_EQ(sent.size(), 500u);
  for (std::size_t i = 0; i < sent.size(); ++i)
    EXPECT_EQ(sent[i].time_usec, static_cast<std::uint64_t>(at(static_cast<int>(6 * i)).t / 1000));
}

TEST(MavlinkReporter, AtTheUpdatesRateNoneIsLeftOut) {
  Wire wire;
  MavlinkConfig config;
  config.rate_hz = 300;
  config.position = config.speed = true;
  Reporter reporter(config, {}, wire.send());
  for (int i = 0; i < 3000; ++i) reporter.add(at(i), 0);
  EXPECT_EQ(wire.all<Odometry>().size(), 3000u);
  EXPECT_EQ(wire.all<VisionPositionEstimate>().size(), 3000u);
  EXPECT_EQ(wire.all<VisionSpeedEstimate>().size(), 3000u);
}

TEST(MavlinkReporter, LostIsSaidThenSilence) {
  Wire wire;
  MavlinkConfig config;
  config.rate_hz = 300;
  config.position = true;
  Reporter reporter(config, {}, wire.send());
  for (int i = 0; i < 10; ++i) reporter.add(at(i, Health::initialising), 0);
  EXPECT_TRUE(wire.all<Odometry>().empty()) << "nothing before it tracks";
  for (int i = 10; i < 20; ++i) reporter.add(at(i), 0);
  for (int i = 20; i < 100; ++i) reporter.add(at(i, Health::lost), 0);
  auto sent = wire.all<Odometry>();
  ASSERT_EQ(sent.size(), 13u);
  for (std::size_t i = 0; i < sent.size(); ++i) EXPECT_EQ(sent[i].quality < 0, i >= 10);
  EXPECT_TRUE(std::isnan(sent.back().pose_covariance[0]));
  EXPECT_EQ(wire.all<VisionPositionEstimate>().size(), 10u);
  reporter.add(at(100), 0);
  sent = wire.all<Odometry>();
  EXPECT_EQ(sent.back().reset_counter, sent.front().reset_counter + 1) << "found again somewhere";
  const auto texts = wire.all<Statustext>();
  ASSERT_EQ(texts.size(), 4u);
  EXPECT_EQ(std::string(texts[2].text.data()), "evpose: lost");
}

TEST(MavlinkReporter, JumpsAreCountedMotionIsNot) {
  Wire wire;
  MavlinkConfig config;
  config.rate_hz = 300;
  Reporter reporter(config, {}, wire.send());
  for (int i = 0; i < 100; ++i) reporter.add(at(i), 0);
  EXPECT_EQ(reporter.reset_counter(), 0);
  for (int i = 100; i < 200; ++i) {
    Update u = at(i);
    u.T_map_body.p.y() += 0.5;
    reporter.add(u, 0);
  }
  EXPECT_EQ(reporter.reset_counter(), 1);
  EXPECT_EQ(wire.all<Odometry>().back().reset_counter, 1);
}

TEST(MavlinkReporter, TheVehiclesClockIsUsedOnceKnown) {
  Wire wire;
  MavlinkConfig config;
  config.rate_hz = 300;
  Reporter reporter(config, {}, wire.send());
  reporter.tick(kNsPerS);
  const auto asked = wire.all<Timesync>();
  ASSERT_EQ(asked.size(), 1u);
  EXPECT_EQ(asked[0].tc1, 0);
  Timesync reply;
  reply.ts1 = asked[0].ts1;
  reply.tc1 = 500 * kNsPerS;  // taken half way through a round trip of 2 ms
  reporter.receive(encode(reply, 0, 1, 1).bytes(), kNsPerS + 2 * kNsPerMs);
  ASSERT_TRUE(reporter.clock().known());
  EXPECT_EQ(reporter.clock().offset_ns(), 499 * kNsPerS - kNsPerMs);
  reply.ts1 += 1;  // not ours
  reply.tc1 = 7;
  reporter.receive(encode(reply, 0, 1, 1).bytes(), kNsPerS + 3 * kNsPerMs);
  EXPECT_EQ(reporter.clock().offset_ns(), 499 * kNsPerS - kNsPerMs);
  reporter.add(at(0), 3 * kNsPerS);
  EXPECT_EQ(wire.all<Odometry>().back().time_usec,
            static_cast<std::uint64_t>((at(0).t + 3 * kNsPerS + 499 * kNsPerS - kNsPerMs) / 1000));
}

TEST(MavlinkReporter, AnswersTimesyncAndTakesTheVehiclesSystem) {
  Wire wire;
  MavlinkConfig config;
  config.set_origin = true;
  config.origin_latitude_deg = 47.5;
  Reporter reporter(config, {}, wire.send());
  Heartbeat vehicle;
  vehicle.autopilot = 3;
  reporter.receive(encode(vehicle, 0, 9, 1).bytes(), 5);
  Timesync request;
  request.ts1 = 1234;
  reporter.receive(encode(request, 1, 9, 1).bytes(), 777);
  ASSERT_EQ(wire.all<Timesync>().size(), 1u);
  EXPECT_EQ(wire.all<Timesync>()[0].tc1, 777);
  EXPECT_EQ(wire.all<Timesync>()[0].ts1, 1234);
  EXPECT_EQ(wire.frames[0].system, 9);
  EXPECT_EQ(wire.frames[0].component, 197);
  reporter.tick(kNsPerS);
  ASSERT_EQ(wire.all<SetGpsGlobalOrigin>().size(), 1u);
  EXPECT_EQ(wire.all<SetGpsGlobalOrigin>()[0].latitude, 475000000);
  EXPECT_EQ(wire.all<Heartbeat>().size(), 1u);
  reporter.receive(encode(GpsGlobalOrigin{}, 2, 9, 1).bytes(), kNsPerS);
  reporter.tick(5 * kNsPerS);
  EXPECT_EQ(wire.all<SetGpsGlobalOrigin>().size(), 1u) << "confirmed";
}

TEST(MavlinkReporter, ThePadIsWhereItIsSeen) {
  Wire wire;
  MavlinkConfig config;
  config.landing_target = true;
  config.pad_x_m = 1 + 2;  // two metres ahead of where it starts, three below
  config.pad_z_m = 1 - 3;
  Reporter reporter(config, {ned_from_heading(M_PI / 2), {}}, wire.send());
  reporter.add(at(0), 0);
  const auto targets = wire.all<LandingTarget>();
  ASSERT_EQ(targets.size(), 1u);
  EXPECT_NEAR(targets[0].x, 2, 1e-6);
  EXPECT_NEAR(targets[0].y, 0, 1e-6);
  EXPECT_NEAR(targets[0].z, 3, 1e-6);
  EXPECT_NEAR(targets[0].distance, std::sqrt(13.0), 1e-6);
  EXPECT_EQ(targets[0].position_valid, 1);
}

TEST(MavlinkLinkCheck, CountsGapsResetsAndFaults) {
  LinkCheck check;
  Odometry good;
  const Matrix6d sound = 1e-4 * Matrix6d::Identity();
  std::size_t k = 0;
  for (int i = 0; i < 6; ++i)
    for (int j = i; j < 6; ++j) good.pose_covariance[k++] = static_cast<float>(sound(i, j));
  for (int i = 0; i < 50; ++i) {
    if (i == 20) continue;  // one is missing
    Odometry m = good;
    m.time_usec = static_cast<std::uint64_t>(20'000 * i);
    m.reset_counter = i < 30 ? 0 : 1;
    if (i == 40) m.pose_covariance[0] = -1;
    check.receive(encode(m, static_cast<std::uint8_t>(i), 1, 197).bytes(), i * 20 * kNsPerMs + 3 * kNsPerMs);
  }
  const auto report = check.report();
  std::string all;
  for (const auto& line : report.lines) all += line + "\n";
  EXPECT_NE(all.find("49 frames, 1 missed"), std::string::npos) << all;
  EXPECT_NE(all.find("1 resets"), std::string::npos) << all;
  EXPECT_NE(all.find("longest gap 40.0 ms"), std::string::npos) << all;
  EXPECT_NE(all.find("p50 3.00 ms"), std::string::npos) << all;
  EXPECT_NE(all.find("LOCAL_FRD / BODY_FRD"), std::string::npos) << all;
  ASSERT_EQ(report.faults.size(), 1u);
  EXPECT_EQ(report.faults[0], "pose_covariance is not positive definite (1 times)");
}

// ---- links ----

TEST(MavlinkLink, BadAddressesAreNamed) {
  for (const char* address :
       {"", "udp:/x:1", "udp://:14550", "udp://127.0.0.1:0", "udp://127.0.0.1:70000", "tcp://a:1",
        "serial:///dev/null:12345", "serial:///dev/evpose-no-such:57600"}) {
    const auto link = Link::open(address);
    ASSERT_FALSE(link) << address;
    EXPECT_FALSE(link.error().fix.empty());
  }
}

TEST(MavlinkLink, DatagramsGoBothWaysAndAPortHasOneOwner) {
  std::unique_ptr<Link> listener;
  std::string port;
  for (int p = 24550; p < 24650 && !listener; ++p) {
    port = std::to_string(p);
    if (auto opened = Link::open("udpin://127.0.0.1:" + port)) listener = std::move(*opened);
  }
  ASSERT_TRUE(listener);
  const auto second = Link::open("udpin://127.0.0.1:" + port);
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().what, "the port is in use");
  auto sender = Link::open("udp://127.0.0.1:" + port);
  ASSERT_TRUE(sender);
  const std::uint8_t bytes[] = {1, 2, 3};
  EXPECT_FALSE(listener->send(bytes)) << "nobody to answer";
  ASSERT_TRUE((*sender)->send(bytes));
  EXPECT_EQ(listener->receive().size(), 3u);
  EXPECT_TRUE(listener->send(Bytes(bytes).first(2)));
  EXPECT_EQ((*sender)->receive().size(), 2u);
}

TEST(MavlinkLink, ASerialLineThatGoesAwayIsNamedAndSurvived) {
  const int master = ::posix_openpt(O_RDWR | O_NOCTTY);
  ASSERT_GE(master, 0);
  ASSERT_EQ(::grantpt(master), 0);
  ASSERT_EQ(::unlockpt(master), 0);
  auto link = Link::open(std::string("serial://") + ::ptsname(master) + ":57600");
  ASSERT_TRUE(link) << link.error().line();
  const std::uint8_t bytes[] = {0xFD, 0, 13, 10, 17};  // no translation of ends of lines, no flow control
  ASSERT_TRUE((*link)->send(bytes));
  std::uint8_t got[16];
  EXPECT_EQ(::read(master, got, sizeof got), 5);
  EXPECT_TRUE(std::equal(bytes, bytes + 5, got));
  ::close(master);
  while ((*link)->descriptor() >= 0) (*link)->send(bytes);
  EXPECT_NE((*link)->take_notice().find("is gone"), std::string::npos);
  EXPECT_FALSE((*link)->send(bytes));
  EXPECT_TRUE((*link)->receive().empty());
  EXPECT_EQ((*link)->counts().lost_devices, 1u);
}

}  // namespace
}  // namespace evpose::mavlink
