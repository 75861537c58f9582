// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/mavlink/reporter.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "evpose/mavlink/messages.h"

namespace evpose::mavlink {
namespace {

TEST(MavlinkReporter, LongWordsComeInChunksThatJoinToTheWhole) {
  for (const std::size_t length : {1U, 41U, 42U, 43U, 92U, 200U}) {
    std::vector<Statustext> sent;
    Parser parser;
    Reporter reporter({}, {}, [&](Bytes bytes) {
      parser.parse(bytes, [&](const Frame& frame) { sent.push_back(decode<Statustext>(frame).value()); });
    });
    std::string words;
    for (std::size_t i = 0; words.size() < length; ++i) words += static_cast<char>('a' + i % 26);
    reporter.stalled(words);
    reporter.stalled(words);
    const std::string whole = "evpose: " + words;
    const std::size_t chunks = sent.size() / 2;
    EXPECT_EQ(chunks, whole.size() <= 50 ? 1 : whole.size() / 50 + 1);
    EXPECT_EQ(sent.front().id != 0, whole.size() > 50);
    if (chunks > 1) {
      EXPECT_NE(sent.front().id, sent.back().id) << "each text has a number of its own";
    }
    std::string joined;
    for (std::size_t k = 0; k < chunks; ++k) {
      EXPECT_EQ(sent[k].chunk_seq, k);
      EXPECT_EQ(sent[k].id, sent.front().id);
      const std::string part(sent[k].text.begin(), std::find(sent[k].text.begin(), sent[k].text.end(), '\0'));
      EXPECT_TRUE(chunks == 1 || (part.size() == 50) == (k + 1 < chunks)) << "only the last ends with zero";
      joined += part;
    }
    EXPECT_EQ(joined, whole);
  }
}

TEST(MavlinkReporter, PosesThatExplainTheEventsAlikeAreNamedAndNotSent) {
  std::string said;
  int texts = 0, others = 0;
  Parser parser;
  Reporter reporter({}, {}, [&](Bytes bytes) {
    parser.parse(bytes, [&](const Frame& frame) {
      const auto words = decode<Statustext>(frame);
      if (!words) return void(++others);
      ++texts;
      EXPECT_EQ(words->severity, 4) << "a warning";
      said.append(words->text.begin(), std::find(words->text.begin(), words->text.end(), '\0'));
    });
  });
  reporter.ambiguous("2 poses explain the events alike: (1, 2, 3), (4, 5, 6)");
  EXPECT_EQ(said, "evpose: ambiguous: 2 poses explain the events alike: (1, 2, 3), (4, 5, 6)");
  EXPECT_EQ(texts, 2);
  EXPECT_EQ(others, 0);
}

class VehiclePlaceLaws : public testing::Test {
 protected:
  VehiclePlaceLaws() {
    config_.origin_latitude_deg = 47.5;
    config_.origin_longitude_deg = 8.5;
    config_.origin_altitude_m = 400;
    message_.lat = 475001000;
    message_.lon = 85000000;
    message_.alt = 412000;
  }
  std::optional<Reporter::VehiclePlace> heard(TimeNs later = kNsPerS) const {
    Reporter reporter(config_, frames_, [](Bytes) {});
    reporter.receive(encode(message_, 0, 1, 1).bytes(), kNsPerS);
    return reporter.vehicle_place(kNsPerS + later);
  }

  MavlinkConfig config_;
  VehicleFrames frames_{{Eigen::Quaterniond(rotation_ned_enu()), {0, 0, 0}}, {}};
  GlobalPositionInt message_;
};

TEST_F(VehiclePlaceLaws, IsEastNorthAndUpOfTheOrigin) {
  const auto place = heard();
  ASSERT_TRUE(place);
  EXPECT_FALSE(place->has_heading);
  EXPECT_NEAR(place->T_map_body.p.x(), 0, 1e-3);
  EXPECT_NEAR(place->T_map_body.p.y(), 11.12, 0.01) << "a ten-thousandth of a degree";
  EXPECT_NEAR(place->T_map_body.p.z(), 12, 1e-3);
}

TEST_F(VehiclePlaceLaws, TheVehiclesForwardAxisHasTheHeading) {
  for (const double heading_deg : {0.0, 90.0, 200.0}) {
    message_.hdg = static_cast<std::uint16_t>(100 * heading_deg);
    const auto place = heard();
    ASSERT_TRUE(place && place->has_heading);
    const double a = heading_deg * M_PI / 180;
    const Eigen::Vector3d forward = place->T_map_body.q * Eigen::Vector3d::UnitX();
    EXPECT_LT((forward - Eigen::Vector3d(std::sin(a), std::cos(a), 0)).norm(), 1e-9) << "x east, y north";
    EXPECT_LT((place->T_map_body.q * Eigen::Vector3d::UnitZ() - Eigen::Vector3d::UnitZ()).norm(), 1e-9);
  }
}

TEST_F(VehiclePlaceLaws, IsWhatTheSentPoseSays) {
  frames_ = {{so3::exp({M_PI, 0.02, 0.7}), {3, 4, 5}}, {so3::exp({0.1, 0.2, 0.3}), {0.2, -0.1, 0.05}}};
  message_.hdg = 12345;
  const auto place = heard();
  ASSERT_TRUE(place);
  Update u;
  u.T_map_body = place->T_map_body;
  const NedState ned = to_ned(u, frames_);
  EXPECT_LT((ned.position - ned_from_llh({47.5001, 8.5, 412}, {47.5, 8.5, 400})).norm(), 1e-7);
  EXPECT_NEAR(euler_of(ned.q_ned_frd).z(), 123.45 * M_PI / 180, 1e-9);
  EXPECT_NEAR(euler_of(ned.q_ned_frd).head<2>().norm(), 0, 1e-9);
}

TEST_F(VehiclePlaceLaws, IsNotThatOfAnotherVehicle) {
  Reporter reporter(config_, frames_, [](Bytes) {});
  Heartbeat ours;
  ours.autopilot = 3;
  reporter.receive(encode(ours, 0, 9, 1).bytes(), kNsPerS);
  reporter.receive(encode(message_, 1, 7, 1).bytes(), kNsPerS);
  EXPECT_FALSE(reporter.vehicle_place(kNsPerS));
  reporter.receive(encode(message_, 2, 9, 1).bytes(), kNsPerS);
  EXPECT_TRUE(reporter.vehicle_place(kNsPerS));
}

TEST_F(VehiclePlaceLaws, IsForgottenAndNeedsAnOrigin) {
  EXPECT_FALSE(heard(3 * kNsPerS));
  config_.origin_latitude_deg = config_.origin_longitude_deg = 0;
  EXPECT_FALSE(heard());
}

}  // namespace
}  // namespace evpose::mavlink
