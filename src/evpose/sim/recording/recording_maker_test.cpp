// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/recording/recording_maker.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>

#include "evpose/io/files/test_files.h"
#include "evpose/io/motion/trajectory_tum.h"
#include "evpose/io/recording/recording.h"

namespace evpose::sim {
namespace {

namespace fs = std::filesystem;

constexpr const char* kScene = R"(
free_space: {low: [-1, -1, 0.5], high: [1, 1, 2]}
materials:
  - {name: bricks, pattern: bricks, size_m: [1, 1], texel_m: 0.01}
  - {name: wood, pattern: planks, size_m: [1, 1], texel_m: 0.01}
lights:
  - {name: lamp, kind: lamp, at: [0, 0, 2.7], candela: 900}
  - {name: all around, kind: ambient, lux: 120}
objects:
  - {name: floor, quad: {corner: [-3, -3, 0], u: [6, 0, 0], v: [0, 6, 0]}, material: wood}
  - {name: ahead, quad: {corner: [3, -3, 0], u: [0, 0, 3], v: [0, 6, 0]}, material: bricks}
  - {name: left, quad: {corner: [-3, 3, 0], u: [6, 0, 0], v: [0, 0, 3]}, material: bricks}
  - {name: right, quad: {corner: [-3, -3, 0], u: [0, 0, 3], v: [6, 0, 0]}, material: bricks}
  - {name: crate, at: [1.8, 0.3, 0], yaw_deg: 20, box: {size: [0.6, 0.8, 1.1]}, material: wood}
)";

// A small room, a small camera, a twentieth of a second.
class MakeRecording : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("evpose_maker_" + std::to_string(::getpid()) + "_" +
                                           ::testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    std::ofstream(folder_ / "scene.yaml") << kScene;
    scenario_.scene_file = (folder_ / "scene.yaml").string();
    scenario_.duration_s = 0.05;
    scenario_.camera.size = SensorSize::custom;
    scenario_.camera.width = 64;
    scenario_.camera.height = 48;
    scenario_.camera.focal_px = 40;
    scenario_.trajectory.centre_x_m = scenario_.trajectory.centre_y_m = 0;
    scenario_.trajectory.centre_z_m = 1.2;
    scenario_.trajectory.size_forward_m = scenario_.trajectory.size_left_m = 1;
    scenario_.trajectory.size_up_m = 0.4;
    scenario_.frames.rate_hz = 100;
    scenario_.frames.exposure_ms = 4;
    scenario_.depth.rate_hz = 20;
    scenario_.truth.events = true;
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::string place(const std::string& name) const { return (folder_ / name).string(); }
  Expected<RecordingCounts> make(const std::string& name, int threads = 1) const {
    return make_recording(scenario_, place(name), threads, {});
  }
  // Content of every file of a folder.
  static std::map<std::string, std::string> content(const std::string& folder) {
    std::map<std::string, std::string> files;
    for (const auto& entry : fs::recursive_directory_iterator(folder)) {
      if (!entry.is_regular_file()) continue;
      std::ostringstream bytes;
      bytes << std::ifstream(entry.path(), std::ios::binary).rdbuf();
      files[fs::relative(entry.path(), folder).string()] = bytes.str();
    }
    return files;
  }

  fs::path folder_;
  Scenario scenario_;
};

TEST_F(MakeRecording, PosesAreOnTheClockOfTheImu) {
  ASSERT_TRUE(make("on_time").ok());
  scenario_.imu.time_offset_s = 0.004;
  ASSERT_TRUE(make("late").ok());
  for (const char* file : {"groundtruth.tum", "groundtruth_camera.tum"}) {
    const auto on_time = read_tum(place("on_time") + "/" + file), late = read_tum(place("late") + "/" + file);
    ASSERT_TRUE(on_time.ok() && late.ok());
    ASSERT_EQ(on_time->size(), late->size());
    for (std::size_t i = 0; i < late->size(); ++i) {
      EXPECT_EQ((*late)[i].t, (*on_time)[i].t + 4 * kNsPerMs);
      EXPECT_EQ((*late)[i].pose.p, (*on_time)[i].pose.p);
    }
  }
}

TEST_F(MakeRecording, GivesTheSameBytesForAnyNumberOfThreads) {
  const auto one = make("one", 1);
  ASSERT_TRUE(one.ok()) << one.error().line();
  EXPECT_GT(one->read_out.delivered, 300);
  const auto a = content(place("one"));
  for (const int threads : {2, 3}) {
    ASSERT_TRUE(make("more", threads).ok());
    const auto b = content(place("more"));
    ASSERT_EQ(a.size(), b.size());
    for (const auto& [name, bytes] : a) EXPECT_EQ(bytes, b.at(name)) << name << ", threads: " << threads;
  }
  for (const char* name :
       {"events.h5", "imu.csv", "groundtruth.tum", "groundtruth_camera.tum", "camchain-imucam.yaml",
        "imu.yaml", "contours.ply", "mesh.ply", "scenario.yaml", "events_truth.h5", "frames/000003.png",
        "frames/timestamps.csv", "depth/000001.png"})
    EXPECT_TRUE(a.contains(name)) << name;
}

TEST_F(MakeRecording, KeptWorldsGiveTheSameBytes) {
  const std::string worlds = place("worlds");
  const auto with_cache = [&](const std::string& name) {
    const auto made = make_recording(scenario_, place(name), 1, {}, worlds);
    EXPECT_TRUE(made.ok()) << made.error().line();
    return content(place(name));
  };
  const auto kept = [&] { return std::distance(fs::directory_iterator(worlds), fs::directory_iterator()); };
  ASSERT_TRUE(make("without").ok());
  const auto without = content(place("without"));
  EXPECT_EQ(with_cache("first"), without);
  EXPECT_EQ(with_cache("second"), without);
  EXPECT_EQ(kept(), 1);
  // The second one was read, not made: what stands in the folder is what comes out.
  const fs::path world = fs::directory_iterator(worlds)->path();
  std::ofstream(world / "contours.ply", std::ios::app) << "kept";
  EXPECT_EQ(with_cache("third").at("contours.ply"), without.at("contours.ply") + "kept");
  // Damaged: made anew.
  fs::resize_file(world / "light.bin", fs::file_size(world / "light.bin") - 1);
  EXPECT_EQ(with_cache("fourth"), without);
  // Other light: another world.
  std::string brighter = kScene;
  brighter.replace(brighter.find("900"), 3, "950");
  std::ofstream(folder_ / "scene.yaml") << brighter;
  EXPECT_NE(with_cache("fifth").at("events.h5"), without.at("events.h5"));
  EXPECT_EQ(kept(), 2);
}

TEST_F(MakeRecording, IsARecordingThatTheTrackerReads) {
  const auto made = make("it");
  ASSERT_TRUE(made.ok()) << made.error().line();
  const auto recording = open_recording(place("it"));
  ASSERT_TRUE(recording.ok()) << recording.error().line();
  EXPECT_EQ(recording->camera.size, (ImageSize{64, 48}));
  EXPECT_TRUE(recording->has_imu);
  EXPECT_EQ(recording->event_count, made->read_out.delivered);
  const Pose expected = T_body_cam(scenario_.camera).inverse();
  EXPECT_LT(recording->T_cam_body.minus(expected).norm(), 1e-9);
}

TEST_F(MakeRecording, HandsOverErrorsAndKeepsTheTruthApart) {
  ASSERT_TRUE(make("true").ok());
  scenario_.handed_over.preset = CalibrationQuality::ordinary;
  ASSERT_TRUE(make("wrong").ok());
  auto exact = content(place("true")), wrong = content(place("wrong"));
  EXPECT_FALSE(exact.contains("camchain-imucam_truth.yaml"));
  EXPECT_TRUE(wrong.contains("handed_over.yaml"));
  EXPECT_EQ(wrong.at("camchain-imucam_truth.yaml"), exact.at("camchain-imucam.yaml"));
  EXPECT_NE(wrong.at("camchain-imucam.yaml"), exact.at("camchain-imucam.yaml"));
  for (const char* name :
       {"events.h5", "imu.csv", "groundtruth.tum", "groundtruth_camera.tum", "contours.ply"})
    EXPECT_EQ(wrong.at(name), exact.at(name)) << name;
  const auto recording = open_recording(place("wrong"));
  ASSERT_TRUE(recording.ok()) << recording.error().line();
  const CalibrationErrors errors =
      draw_calibration_errors(scenario_.handed_over, static_cast<std::uint64_t>(scenario_.seed));
  EXPECT_NEAR(recording->camera.fx, 40 * (1 + errors.focal), 1e-9);
}

TEST_F(MakeRecording, EventsFollowTheSensorsPreset) {
  scenario_.events.preset = EventSensorPreset::dvxplorer;
  const auto made = make("it");
  ASSERT_TRUE(made.ok()) << made.error().line();
  const auto& n = made->read_out;
  EXPECT_GT(n.delivered, 300);
  EXPECT_GT(n.late, n.delivered / 2);  // frames of 0.2 ms
  EXPECT_EQ(n.in, n.delivered + n.lost + n.trailing + n.shed);
  scenario_.events.threshold_on = 0.01;
  const auto refused = make("refused");
  ASSERT_FALSE(refused.ok());
  EXPECT_NE(refused.error().line().find("events.threshold_on"), std::string::npos);
}

TEST_F(MakeRecording, ReplacesItsOwnAndNothingElse) {
  ASSERT_TRUE(make("it").ok());
  ASSERT_TRUE(make("it").ok());
  fs::create_directories(folder_ / "other");
  std::ofstream(folder_ / "other" / "letter.txt") << "dear";
  const auto refused = make("other");
  ASSERT_FALSE(refused.ok());
  EXPECT_NE(refused.error().line().find("is there already"), std::string::npos);
  EXPECT_TRUE(fs::exists(folder_ / "other" / "letter.txt"));
}

TEST_F(MakeRecording, RefusesWhatCannotBeFlown) {
  const auto line = [&] {
    const auto made = make("refused");
    EXPECT_FALSE(made.ok());
    EXPECT_FALSE(fs::exists(folder_ / "refused"));
    return made.ok() ? std::string() : made.error().line();
  };
  const Scenario good = scenario_;
  scenario_.trajectory.centre_x_m = 5;
  EXPECT_NE(line().find("inside of something"), std::string::npos) << line();
  scenario_ = good;
  scenario_.integrator.max_flow_px_s = 1;
  EXPECT_NE(line().find("px/s"), std::string::npos) << line();
  scenario_ = good;
  scenario_.frames.exposure_ms = 50;
  EXPECT_NE(line().find("do not fit"), std::string::npos) << line();
  scenario_ = good;
  std::string dark = kScene;
  for (const char* light : {"900", "120"}) dark.replace(dark.find(light), 3, "0  ");
  std::ofstream(folder_ / "scene.yaml") << dark;
  EXPECT_NE(line().find("contrast"), std::string::npos) << line();
}

}  // namespace
}  // namespace evpose::sim
