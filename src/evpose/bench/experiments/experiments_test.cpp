// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "evpose/bench/experiments/fault_injection.h"
#include "evpose/bench/experiments/variants.h"

namespace evpose::experiments {
namespace {

constexpr TimeNs kBegin = kNsPerS, kFrom = kBegin + 100 * kNsPerMs, kTo = kBegin + 200 * kNsPerMs;
constexpr ImageSize kSize{64, 48};

/// 300 ms at 1 kHz; no two samples are alike.
std::vector<ImuSample> steady_imu() {
  std::vector<ImuSample> out(300);
  for (std::size_t i = 0; i < out.size(); ++i) {
    const double v = 0.1 * std::sin(0.01 * static_cast<double>(i));
    out[i].t = kBegin + static_cast<TimeNs>(i) * kNsPerMs;
    out[i].gyro = {v, 2 * v, 3 * v};
    out[i].accel = {v, 0.5 * v, 9.81 + v};
  }
  return out;
}

/// 300 packets of a millisecond with four events each.
std::vector<EventPacket> steady_events() {
  std::vector<EventPacket> out(300);
  for (std::size_t i = 0; i < out.size(); ++i) {
    out[i].base = kBegin + static_cast<TimeNs>(i) * kNsPerMs;
    for (std::uint32_t k = 0; k < 4; ++k)
      out[i].events.push_back(make_event(200 * k, static_cast<int>(i % 60), 3 + static_cast<int>(k), true));
  }
  return out;
}

bool same(const ImuSample& a, const ImuSample& b) {
  return a.t == b.t && a.gyro == b.gyro && a.accel == b.accel;
}

bool same(const EventPacket& a, const EventPacket& b) {
  return a.base == b.base && a.events.size() == b.events.size() &&
         std::equal(a.events.begin(), a.events.end(), b.events.begin(), [](const Event& x, const Event& y) {
           return x.dt_us == y.dt_us && x.x == y.x && x.y == y.y && x.on == y.on;
         });
}

std::vector<ImuSample> with_imu_fault(Fault fault) {
  std::vector<ImuSample> imu = steady_imu();
  std::mt19937 random(7);
  inject_imu_fault({fault, kFrom, kTo}, random, &imu);
  return imu;
}

std::vector<EventPacket> with_event_fault(Fault fault) {
  std::vector<EventPacket> packets = steady_events();
  std::mt19937 random(7);
  inject_event_fault({fault, kFrom, kTo}, kSize, random, &packets);
  return packets;
}

TEST(FaultInjection, OfTheImuChangesSamplesOfTheWindowAndNoneBeforeIt) {
  const std::vector<ImuSample> before = steady_imu();
  for (auto fault = static_cast<int>(Fault::imu_gap); fault <= static_cast<int>(Fault::imu_spike); ++fault) {
    const std::vector<ImuSample> after = with_imu_fault(static_cast<Fault>(fault));
    ASSERT_GE(after.size(), 100U) << kFaultNames[static_cast<std::size_t>(fault)];
    for (std::size_t i = 0; i < 100; ++i) EXPECT_TRUE(same(after[i], before[i])) << i;
    const bool unchanged = after.size() == before.size() &&
                           std::equal(after.begin(), after.end(), before.begin(),
                                      [](const ImuSample& a, const ImuSample& b) { return same(a, b); });
    EXPECT_FALSE(unchanged) << kFaultNames[static_cast<std::size_t>(fault)];
  }
}

TEST(FaultInjection, OfTheEventsChangesPacketsOfTheWindowAndNoOthers) {
  const std::vector<EventPacket> before = steady_events();
  for (const Fault fault :
       {Fault::events_drop_out, Fault::events_burst, Fault::events_packet_loss, Fault::events_stuck_rows}) {
    const std::vector<EventPacket> after = with_event_fault(fault);
    ASSERT_EQ(after.size(), before.size());
    std::size_t changed = 0;
    for (std::size_t i = 0; i < before.size(); ++i) {
      if (i >= 100 && i < 200)
        changed += same(after[i], before[i]) ? 0 : 1;
      else
        EXPECT_TRUE(same(after[i], before[i])) << i;
    }
    EXPECT_GE(changed, 50U) << kFaultNames[static_cast<std::size_t>(fault)];
  }
}

TEST(FaultInjection, AGapLeavesNoSampleOfTheWindow) {
  for (const ImuSample& s : with_imu_fault(Fault::imu_gap)) EXPECT_TRUE(s.t < kFrom || s.t >= kTo);
}

TEST(FaultInjection, AJumpOfTheClockLastsAndKeepsIntervals) {
  const std::vector<ImuSample> before = steady_imu(), after = with_imu_fault(Fault::imu_jump_ahead);
  ASSERT_EQ(after.size(), before.size());
  const TimeNs jump = after.back().t - before.back().t;
  EXPECT_GE(jump, 30 * kNsPerMs);
  EXPECT_LE(jump, 200 * kNsPerMs);
  for (std::size_t i = 100; i < before.size(); ++i) EXPECT_EQ(after[i].t - before[i].t, jump) << i;
}

TEST(FaultInjection, ADropOutLeavesNoEventOfTheWindow) {
  const std::vector<EventPacket> after = with_event_fault(Fault::events_drop_out);
  for (std::size_t i = 100; i < 200; ++i) EXPECT_TRUE(after[i].empty()) << i;
}

TEST(FaultInjection, EventsOfAPacketStayInOrderOfTimeAndInsideTheImage) {
  for (const Fault fault : {Fault::events_burst, Fault::events_stuck_rows})
    for (const EventPacket& packet : with_event_fault(fault)) {
      EXPECT_TRUE(std::is_sorted(packet.events.begin(), packet.events.end(),
                                 [](const Event& a, const Event& b) { return a.dt_us < b.dt_us; }));
      for (const Event& e : packet.events) EXPECT_TRUE(e.x < kSize.width && e.y < kSize.height);
    }
}

TEST(Streams, AnExcerptHoldsTheEventsBetweenTwoTimesAndImuAround) {
  Streams streams;
  streams.packets = steady_events();
  streams.imu = steady_imu();
  const Excerpt part = excerpt(streams, kFrom, kTo);
  ASSERT_EQ(part.packets.size(), 100U);
  EXPECT_EQ(part.packets.front().base, kFrom);
  EXPECT_EQ(part.packets.back().base, kTo - kNsPerMs);
  EXPECT_EQ(part.imu.front().t, kFrom - 20 * kNsPerMs);
  EXPECT_EQ(part.imu.back().t, kTo + 19 * kNsPerMs);
}

TEST(Streams, TheStartHasTheVelocityOfTheTruth) {
  const Eigen::Vector3d velocity(1, -2, 0.5);
  std::vector<TimedPose> truth(200);
  for (std::size_t i = 0; i < truth.size(); ++i) {
    truth[i].t = kBegin + static_cast<TimeNs>(i) * kNsPerMs;
    truth[i].pose.p = velocity * to_seconds(truth[i].t - kBegin);
  }
  const StartState start = start_at(truth, kFrom + kNsPerMs / 2);
  EXPECT_LT((start.T_map_body.p - velocity * 0.1005).norm(), 1e-9);
  EXPECT_LT((start.velocity - velocity).norm(), 1e-6);
  EXPECT_LT(start.angular_rate_body.norm(), 1e-9);
}

TEST(Variants, EverySettingIsOneOfTheTracker) {
  for (const auto* variants : {&back_end_variants(), &ablation_variants(), &paper_variants()})
    for (const Variant& variant : *variants) {
      const auto config = configure(variant.settings);
      EXPECT_TRUE(config) << variant.name << ": " << (config ? "" : config.error().line());
    }
}

TEST(Variants, HaveNamesOfTheirOwn) {
  for (const auto* variants : {&back_end_variants(), &ablation_variants(), &paper_variants()}) {
    std::set<std::string> names;
    for (const Variant& variant : *variants) EXPECT_TRUE(names.insert(variant.name).second) << variant.name;
  }
}

}  // namespace
}  // namespace evpose::experiments
