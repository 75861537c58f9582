// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/demo_recording.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <map>

#include "evpose/io/atomic_file.h"
#include "evpose/io/recording.h"

namespace evpose::sim {
namespace {

class DemoRecording : public ::testing::Test {
 protected:
  void SetUp() override { std::filesystem::remove_all(base_); }
  void TearDown() override { std::filesystem::remove_all(base_); }

  std::string make(const std::string& name, DemoOptions options) {
    options.size = {96, 72};
    options.duration_s = 0.08;
    std::string folder = (base_ / name).string();
    const Status made = make_demo_recording(folder, options, [&](double share) { last_share_ = share; });
    EXPECT_TRUE(made.ok()) << (made.ok() ? "" : made.error().line());
    return folder;
  }
  static std::string events(const std::string& folder) {
    std::string all;
    auto reader = open_events(open_recording(folder).value());
    EXPECT_TRUE(reader.ok());
    EventPacket packet;
    for (auto more = (*reader)->next(packet); more && *more; more = (*reader)->next(packet)) {
      for (const Event& e : packet.events)
        all += text(packet.time(e), " ", e.x, " ", int{e.y}, " ", int{e.on}, "\n");
    }
    return all;
  }
  // By file name; of the events their text, as an HDF5 file also says when it was written.
  static std::map<std::string, std::string> contents(const std::string& folder) {
    std::map<std::string, std::string> all;
    for (const auto& entry : std::filesystem::directory_iterator(folder)) {
      const std::string name = entry.path().filename().string();
      all[name] = name == "events.h5" ? events(folder) : read_text_file(entry.path().string()).value();
    }
    return all;
  }

  // Of this process alone: tests run side by side.
  std::filesystem::path base_ =
      std::filesystem::path(::testing::TempDir()) / ("evpose_demo_" + std::to_string(::getpid()));
  double last_share_ = 0;
};

TEST_F(DemoRecording, SameSeedGivesTheSameContentForAnyThreads) {
  const auto one = contents(make("one", {.seed = 3, .threads = 1}));
  const auto two = contents(make("two", {.seed = 3, .threads = 2}));
  const auto other = contents(make("other", {.seed = 4, .threads = 2}));
  EXPECT_EQ(last_share_, 1);
  ASSERT_EQ(one.size(), 8u);
  for (const auto& [name, content] : one) {
    EXPECT_EQ(content == two.at(name), true) << name;
    const bool depends =
        name == "events.h5" || name == "imu.csv" || name == "groundtruth.tum" || name == "scenario.yaml";
    EXPECT_EQ(content != other.at(name), depends) << name;
  }
}

TEST_F(DemoRecording, OpensAsARecording) {
  const auto recording = open_recording(make("one", {}));
  ASSERT_TRUE(recording) << recording.error().line();
  EXPECT_TRUE(recording->has_imu);
  EXPECT_EQ(recording->camera.size, (ImageSize{96, 72}));
  const auto truth = read_groundtruth(*recording);
  ASSERT_TRUE(truth) << truth.error().line();
  EXPECT_EQ(truth->size(), 81u);
  EXPECT_GT(recording->event_count, 1000);
}

TEST_F(DemoRecording, OptionsOutOfRangeAreRefusedByName) {
  const auto refused = [&](DemoOptions options) {
    const Status made = make_demo_recording((base_ / "never").string(), options, nullptr);
    return made ? std::string("accepted") : made.error().where;
  };
  EXPECT_EQ(refused({.size = {16, 72}}), "demo size");
  EXPECT_EQ(refused({.duration_s = -1}), "demo duration");
  EXPECT_EQ(refused({.threads = 0}), "demo threads");
  EXPECT_FALSE(std::filesystem::exists(base_));
}

}  // namespace
}  // namespace evpose::sim
