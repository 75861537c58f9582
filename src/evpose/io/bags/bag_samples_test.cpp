// SPDX-License-Identifier: BSD-3-Clause
// Bags of other makers' recorders, of the shared data, against the answers that stand beside them.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "evpose/io/bags/bag_reader.h"
#include "evpose/io/bags/bag_streams.h"
#include "evpose/io/events/test_columns.h"
#include "evpose/io/files/test_files.h"

namespace evpose {
namespace {

using Json = nlohmann::json;

std::string sample(const std::string& name) { return shared_folder() + "/data/real/formats/" + name; }

Json answers_of(const std::string& name) {
  return Json::parse(content_of(sample("known_answers.json"))).at(name);
}

struct File {
  const char* name;
  bool stamps_in_ns;         ///< of the answers
  std::int64_t nanoseconds;  ///< which all stamps of the answers have beyond whole microseconds
};

class KnownBag : public ::testing::TestWithParam<File> {
 protected:
  std::string name() const { return GetParam().name; }
};

TEST_P(KnownBag, EventsAreTheKnownOnes) {
  EVPOSE_NEEDS_SHARED(sample(name()));
  const Json known = answers_of(name());
  auto reader = open_events_bag(sample(name()), {});
  ASSERT_TRUE(reader.ok()) << error_line(reader);
  const auto c = read_columns(**reader);
  ASSERT_TRUE(c.ok()) << error_line(c);
  const auto stamp = [&](std::int64_t us) {
    return GetParam().stamps_in_ns ? us * 1000 + GetParam().nanoseconds : us;
  };
  std::vector<std::int64_t> t;
  for (const std::int64_t us : c->t_us) t.push_back(stamp(us));
  EXPECT_EQ(t.size(), known["events"].get<std::size_t>());
  EXPECT_EQ(sum(c->x), known["sum_x"].get<std::uint64_t>());
  EXPECT_EQ(sum(c->y), known["sum_y"].get<std::uint64_t>());
  EXPECT_EQ(sum(c->p), known["on"].get<std::uint64_t>());
  EXPECT_EQ(t.front(), known["t_first"].get<std::int64_t>());
  EXPECT_EQ(t.back(), known["t_last"].get<std::int64_t>());
  EXPECT_EQ(digest(t), known["sha3_224"]["t"].get<std::string>());
  EXPECT_EQ(digest(c->x), known["sha3_224"]["x"].get<std::string>());
  EXPECT_EQ(digest(c->y), known["sha3_224"]["y"].get<std::string>());
  EXPECT_EQ(digest(c->p), known["sha3_224"]["p"].get<std::string>());

  EXPECT_EQ(stamp((*reader)->extent().first_ns / kNsPerUs), known["t_first"].get<std::int64_t>());
  EXPECT_EQ(stamp((*reader)->extent().last_ns / kNsPerUs), known["t_last"].get<std::int64_t>());
  const Json& geometry = known["container"]["geometry"];
  EXPECT_EQ((*reader)->size(), (ImageSize{geometry[0].get<int>(), geometry[1].get<int>()}));
}

TEST_P(KnownBag, ContainerIsTheKnownOne) {
  EVPOSE_NEEDS_SHARED(sample(name()));
  const Json known = answers_of(name())["container"];
  const auto streams = list_bag_streams(sample(name()));
  ASSERT_TRUE(streams.ok()) << error_line(streams);
  ASSERT_EQ(streams->size(), 1u);
  EXPECT_EQ(streams->front().kind, StreamKind::events);
  EXPECT_EQ(streams->front().name, known["topic"].get<std::string>());
  EXPECT_EQ(streams->front().messages, known["messages"].get<std::int64_t>());

  auto bag = open_bag(sample(name()));
  ASSERT_TRUE(bag.ok()) << error_line(bag);
  std::vector<TimeNs> received;
  BagMessage message;
  for (auto more = (*bag)->next(message); more.ok() && *more; more = (*bag)->next(message))
    received.push_back(message.t);
  ASSERT_EQ(received.size(), known["messages"].get<std::size_t>());
  EXPECT_EQ(received.front(), known["first_receive_ns"].get<TimeNs>());
  EXPECT_EQ(received.back(), known["last_receive_ns"].get<TimeNs>());
}

TEST_P(KnownBag, TriggersAreTheKnownOnes) {
  EVPOSE_NEEDS_SHARED(sample(name()));
  const Json known = answers_of(name());
  std::vector<Trigger> triggers;
  SensorSink sink;
  sink.trigger = [&](const Trigger& t) { triggers.push_back(t); };
  const auto status = read_bag_sensors(sample(name()), "", sink);
  ASSERT_TRUE(status.ok()) << error_line(status);
  ASSERT_EQ(triggers.size(), known.value("triggers", std::size_t{0}));
  if (triggers.empty()) return;
  std::int64_t total = 0, on = 0;
  for (const Trigger& t : triggers) {
    total += t.t / kNsPerUs;
    on += t.on ? 1 : 0;
    EXPECT_EQ(t.id, known["trigger_ids"][0].get<int>());
  }
  EXPECT_EQ(total, known["trigger_sum_t"].get<std::int64_t>());
  EXPECT_EQ(on, known["trigger_p1"].get<std::int64_t>());
  EXPECT_EQ(triggers.front().t, known["trigger_t_first"].get<std::int64_t>() * kNsPerUs);
  EXPECT_EQ(triggers.back().t, known["trigger_t_last"].get<std::int64_t>() * kNsPerUs);
}

INSTANTIATE_TEST_SUITE_P(Files, KnownBag,
                         ::testing::Values(File{"event_packet_evt3_ros1.bag", false, 0},
                                           File{"event_packet_evt3_ros2.db3", false, 0},
                                           File{"event_packet_evt3_trigger.db3", false, 0},
                                           File{"event_packet_libcaer_cmp.mcap", false, 0},
                                           File{"event_packet_libcaer_rollover.db3", true, 18},
                                           File{"event_packet_mono.db3", true, 0}),
                         [](const auto& file) {
                           const std::string name = file.param.name;
                           return name.substr(0, name.find('.'));
                         });

TEST(KnownPoseBag, PosesAreTheKnownOnes) {
  const std::string name = "pose_dsec_zurich_city_04.bag";
  EVPOSE_NEEDS_SHARED(sample(name));
  const Json known = answers_of(name);
  const auto streams = list_bag_streams(sample(name));
  ASSERT_TRUE(streams.ok()) << error_line(streams);
  ASSERT_EQ(streams->size(), 1u);
  EXPECT_EQ(streams->front().kind, StreamKind::poses);
  EXPECT_EQ(streams->front().messages, 6205);
  std::vector<TimedPose> poses;
  SensorSink sink;
  sink.pose = [&](const TimedPose& p) { poses.push_back(p); };
  const auto status = read_bag_sensors(sample(name), "/pose", sink);
  ASSERT_TRUE(status.ok()) << error_line(status);
  ASSERT_EQ(poses.size(), 6205u);
  EXPECT_EQ(poses.front().t, known["stamp_first_ns"].get<TimeNs>());
  EXPECT_EQ(poses.back().t, known["stamp_last_ns"].get<TimeNs>());
  const auto row = [](const TimedPose& p) {
    Eigen::Matrix<double, 7, 1> v;
    v << p.pose.p, p.pose.q.coeffs();
    return v;
  };
  Eigen::Matrix<double, 7, 1> mean = Eigen::Matrix<double, 7, 1>::Zero();
  for (const TimedPose& p : poses) mean += row(p) / 6205;
  for (int k = 0; k < 7; ++k) {
    const auto i = static_cast<std::size_t>(k);
    // Quaternions are normalised on reading; the stored norms are off by up to 1e-6.
    EXPECT_NEAR(row(poses.front())[k], known["pose_first_xyz_qxyzw"][i].get<double>(), k < 3 ? 0 : 1e-6);
    EXPECT_NEAR(row(poses.back())[k], known["pose_last_xyz_qxyzw"][i].get<double>(), k < 3 ? 0 : 1e-6);
    EXPECT_NEAR(mean[k], known["mean_xyz_qxyzw"][i].get<double>(), 1e-6);
  }
}

/// Cut anywhere, a bag gives an error line or fewer messages.
class CutBag : public ::testing::TestWithParam<const char*> {};

TEST_P(CutBag, EndsInOrderWhereverItIsCut) {
  EVPOSE_NEEDS_SHARED(sample(GetParam()));
  const std::string whole = content_of(sample(GetParam()));
  const auto answers = answers_of(GetParam());
  const std::int64_t all = answers.contains("events") ? answers["events"].get<std::int64_t>() : 6205;
  const TemporaryFolder folder;
  // Every byte of the head and of the end, and steps that are no multiple of anything between.
  const std::size_t step = whole.size() / 41 + 97;
  std::vector<std::size_t> lengths;
  for (std::size_t n = 0; n < std::min<std::size_t>(whole.size(), 5000); n += n < 64 ? 1 : 97)
    lengths.push_back(n);
  for (std::size_t n = 5000; n < whole.size(); n += step) lengths.push_back(n);
  for (std::size_t n = 1; n < std::min<std::size_t>(whole.size(), 300); n += 7)
    lengths.push_back(whole.size() - n);
  for (const std::size_t length : lengths) {
    const std::string path = folder.file("cut", std::string_view(whole).substr(0, length));
    std::int64_t count = 0;
    SensorSink sink;
    sink.pose = [&](const TimedPose&) { ++count; };
    expect_no_harm(read_bag_sensors(path, "", sink), path, length);
    auto reader = open_events_bag(path, {});
    if (reader.ok()) {
      const auto c = read_columns(**reader);
      expect_no_harm(c, path, length);
      if (c.ok()) count += static_cast<std::int64_t>(c->t_us.size());
    } else {
      expect_no_harm(reader, path, length);
    }
    EXPECT_LE(count, all) << length;
  }
}

INSTANTIATE_TEST_SUITE_P(Files, CutBag,
                         ::testing::Values("event_packet_evt3_ros1.bag", "event_packet_libcaer_cmp.mcap",
                                           "event_packet_mono.db3", "pose_dsec_zurich_city_04.bag"),
                         [](const auto& file) {
                           const std::string name = file.param;
                           return name.substr(0, name.find('.'));
                         });

}  // namespace
}  // namespace evpose
