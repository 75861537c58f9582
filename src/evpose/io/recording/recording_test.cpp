// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/recording/recording.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "evpose/io/calibration/kalibr.h"
#include "evpose/io/events/events_h5.h"
#include "evpose/io/files/test_files.h"
#include "evpose/io/motion/trajectory_tum.h"

namespace evpose {
namespace {

/// A sound recording of half a second, to be spoilt.
struct Parts {
  TimeNs events_start = 0, imu_start = 0;
  double gyro_scale = 1, accel_scale = 1;
  bool imu = true, extrinsics = true, groundtruth = true;
  std::string yaml;

  std::string write(const TemporaryFolder& parent) const {
    std::string folder = parent / "flight";
    std::filesystem::remove_all(folder);
    std::filesystem::create_directory(folder);
    auto writer = EventWriterH5::create(folder + "/events.h5", {64, 48}, "");
    EventPacket packet;
    packet.base = events_start;
    for (std::uint32_t i = 0; i < 500; ++i)
      packet.events.push_back(
          make_event(i * 1000, static_cast<int>(i % 64), static_cast<int>(i % 48), i % 2 == 0));
    EXPECT_TRUE(writer->append(packet).ok() && writer->finish().ok());
    CalibratedCamera camera;
    camera.intrinsics = CameraIntrinsics{60, 60, 31.5, 23.5, "none", {}, {64, 48}};
    if (extrinsics) camera.T_cam_imu = Pose{Eigen::Quaterniond::Identity(), {0.1, 0, 0}};
    camera.timeshift_cam_imu_s = 0.002;
    EXPECT_TRUE(write_kalibr_camera(folder + "/camchain-imucam.yaml", camera).ok());
    if (imu) write_imu(folder);
    if (groundtruth) {
      std::vector<TimedPose> poses;
      for (int i = 0; i < 50; ++i)
        poses.push_back({i * 10 * kNsPerMs, {so3::exp({0, 0, 0.01 * i}), {0.1 * i, 0, 1}}});
      EXPECT_TRUE(write_tum(folder + "/groundtruth.tum", poses).ok());
    }
    EXPECT_TRUE(yaml.empty() || write_text_file(folder + "/recording.yaml", yaml).ok());
    return folder;
  }

  void write_imu(const std::string& folder) const {
    std::vector<ImuSample> samples;
    for (int i = 0; i < 500; ++i)
      samples.push_back({imu_start + i * kNsPerMs, gyro_scale * Eigen::Vector3d(0, 0, 1),
                         accel_scale * Eigen::Vector3d(0.1, 0, 9.81)});
    EXPECT_TRUE(write_imu_csv(folder + "/imu.csv", samples).ok());
    EXPECT_TRUE(write_kalibr_imu(folder + "/imu.yaml", {}).ok());
  }
};

std::string refusal(const Parts& parts) {
  const TemporaryFolder parent;
  return error_line(open_recording(parts.write(parent)));
}

TEST(Recording, DefaultNames) {
  const TemporaryFolder parent;
  const auto r = open_recording(Parts{}.write(parent) + "/");
  ASSERT_TRUE(r.ok()) << error_line(r);
  EXPECT_EQ(r->name, "flight");
  EXPECT_TRUE(r->has_imu);
  EXPECT_EQ(r->T_cam_body.p.x(), 0.1);
  EXPECT_EQ(r->event_count, 500);
  EXPECT_EQ(r->first_ns, 2 * kNsPerMs);  // the events' first stamp with the shift to the IMU's clock
  EXPECT_EQ(r->last_ns, 499 * kNsPerMs);
  EXPECT_EQ(r->contours_path, "");
  auto events = open_events(*r);
  EventPacket packet;
  ASSERT_TRUE((*events)->next(packet).value());
  EXPECT_EQ(packet.time(packet.events[0]), 2 * kNsPerMs);
  auto imu = open_imu(*r);
  ImuSample sample;
  ASSERT_TRUE(imu->next(sample).value());
  EXPECT_EQ(sample.gyro.z(), 1);
  EXPECT_EQ(read_groundtruth(*r).value().size(), 50u);
}

TEST(Recording, EveryOverrideReachesItsPlace) {
  const TemporaryFolder parent;
  Parts parts;
  parts.yaml =
      "version: 1\nname: x\ndescription: y\ncreated_by: z\n"
      "events: {time_unit: us, flip_x: true, resolution: [64, 48], camera: 0, format: h5}\n"
      "imu: {gyro_unit: deg/s, accel_unit: m/s^2, columns: [timestamp_ns, wx, wy, wz, ax, ay, az]}\n"
      "time: {offset_events_s: 0.1, offset_groundtruth_s: 1.5, t_start_s: 0.2, t_end_s: 0.3}\n"
      "groundtruth:\n  body: marker\n  world: mocap\n  T_body_imu: [1,0,0,0, 0,1,0,0, 0,0,1,2, 0,0,0,1]\n"
      "frames:\n  map: hall\n  T_map_world: [[0,-1,0,5],[1,0,0,0],[0,0,1,0],[0,0,0,1]]\n"
      "  T_ned_map: [[0,1,0,0],[1,0,0,0],[0,0,-1,0],[0,0,0,1]]\n"
      "initial_pose: {t_ns: 7, p: [1, 2, 3], q_xyzw: [0, 0, 0, 1], sigma_p: 0.3, sigma_q_deg: 5}\n";
  const auto r = open_recording(parts.write(parent));
  ASSERT_TRUE(r.ok()) << error_line(r);
  EXPECT_EQ(r->name, "x");
  EXPECT_TRUE(r->event_options.flip_x);
  EXPECT_EQ(r->event_options.offset_ns, 102 * kNsPerMs);
  EXPECT_TRUE(r->imu_options.gyro_in_degrees);
  EXPECT_EQ(r->first_ns, 200 * kNsPerMs);
  EXPECT_EQ(r->last_ns, 300 * kNsPerMs);
  ASSERT_TRUE(r->initial_pose.has_value());
  EXPECT_EQ(r->initial_pose->T_map_body.p.z(), 3);
  EXPECT_EQ(r->initial_pose->sigma_q_deg, 5);
  EXPECT_EQ((*r->T_ned_map)(2, 2), -1);
  const auto truth = read_groundtruth(*r);
  ASSERT_TRUE(truth.ok()) << error_line(truth);
  EXPECT_EQ(truth->front().t, 1'500 * kNsPerMs);
  // World (0, 0, 1) is map (5, 0, 1); the IMU stands 2 m above the marker.
  EXPECT_LT((truth->front().pose.p - Eigen::Vector3d(5, 0, 3)).norm(), 1e-9);
  auto events = open_events(*r, 1.0);
  EventPacket packet;
  std::size_t count = 0;
  while ((*events)->next(packet).value()) count += packet.events.size();
  EXPECT_EQ(count, 100u);
}

TEST(Recording, GroundTruthOfTheCameraBecomesThatOfTheBody) {
  const TemporaryFolder parent;
  Parts parts;
  parts.yaml = "groundtruth:\n  body: camera\n";
  const auto r = open_recording(parts.write(parent));
  ASSERT_TRUE(r.ok()) << error_line(r);
  EXPECT_LT((read_groundtruth(*r)->front().pose.p - Eigen::Vector3d(0.1, 0, 1)).norm(), 1e-9);
}

TEST(Recording, WithoutImuTheBodyIsTheCamera) {
  const TemporaryFolder parent;
  Parts parts;
  parts.imu = parts.extrinsics = parts.groundtruth = false;
  const auto r = open_recording(parts.write(parent));
  ASSERT_TRUE(r.ok()) << error_line(r);
  EXPECT_FALSE(r->has_imu);
  EXPECT_TRUE(r->T_cam_body.matrix().isIdentity());
  EXPECT_TRUE(says(error_line(read_groundtruth(*r)), {"groundtruth.tum", "no ground truth"}));
}

TEST(Recording, WhatDoesNotFitTogetherIsRefused) {
  Parts parts;
  parts.imu_start = 20 * kNsPerS;
  EXPECT_TRUE(says(refusal(parts), {"imu.csv", "20.000000 s", "do not overlap"}));
  parts.imu_start = 1'700'000'000 * kNsPerS;
  EXPECT_TRUE(says(refusal(parts), {"different epochs", "time.offset_events_s"}));
  parts.groundtruth = false;
  parts.yaml = "time:\n  offset_events_s: 1.7e9\n";
  EXPECT_EQ(refusal(parts), "(no error)");
  parts = {};
  parts.extrinsics = false;
  EXPECT_TRUE(says(refusal(parts), {"camchain-imucam.yaml", "T_cam_imu"}));
  parts = {};
  parts.accel_scale = 1 / 9.80665;
  EXPECT_TRUE(says(refusal(parts), {"imu.csv", "imu.accel_unit: g"}));
  parts.yaml = "imu:\n  accel_unit: g\n";
  EXPECT_EQ(refusal(parts), "(no error)");
  parts = {};
  parts.gyro_scale = 180 / std::numbers::pi;
  EXPECT_TRUE(says(refusal(parts), {"imu.csv", "imu.gyro_unit: deg/s"}));
  parts.gyro_scale = 10;  // slow in deg/s: only the ground truth tells
  EXPECT_EQ(refusal(parts), "(no error)");
  parts = {};
  parts.yaml = "time:\n  t_start_s: 7\n";
  EXPECT_TRUE(says(refusal(parts), {"time.t_start_s"}));
  parts.yaml = "events:\n  resolution: [65, 48]\n";
  EXPECT_TRUE(says(refusal(parts), {"64 x 48", "65 x 48", "events.resolution"}));
}

TEST(Recording, YamlErrorsNameTheLine) {
  const auto error = [](const std::string& yaml) {
    Parts parts;
    parts.yaml = yaml;
    return refusal(parts);
  };
  EXPECT_TRUE(says(error("version: 1\nimu:\n  acel_unit: g\n"),
                   {"recording.yaml:3", "imu.acel_unit", "imu.accel_unit"}));
  EXPECT_TRUE(says(error("evnts: 1\n"), {"recording.yaml:1", "evnts"}));
  EXPECT_TRUE(says(error("events: 1\n"), {"recording.yaml:1", "events"}));
  EXPECT_TRUE(says(error("version: 2\n"), {"recording.yaml:1", "version 2"}));
  EXPECT_TRUE(says(error("files:\n  events: ../events.h5\n"), {"recording.yaml:2", "inside the folder"}));
  EXPECT_TRUE(says(error("files:\n  events: a/../../b\n"), {"recording.yaml:2", "inside the folder"}));
  EXPECT_TRUE(says(error("files:\n  events: /events.h5\n"), {"recording.yaml:2", "inside the folder"}));
  EXPECT_TRUE(says(error("files:\n  imu: other.csv\n"), {"other.csv", "no such file"}));
  EXPECT_TRUE(says(error("events:\n  format: aedat5\n"), {"recording.yaml:2", "aedat5", "aedat4"}));
  EXPECT_TRUE(says(error("imu:\n  gyro_unit: rpm\n"), {"recording.yaml:2", "rad/s | deg/s"}));
  EXPECT_TRUE(says(error("events:\n  flip_x: yes\n"), {"recording.yaml:2", "true nor false"}));
  EXPECT_TRUE(says(error("time:\n  t_start_s: .nan\n"), {"recording.yaml:2", "finite"}));
  EXPECT_TRUE(says(error("groundtruth:\n  body: marker\n"), {"recording.yaml", "groundtruth.T_body_imu"}));
  EXPECT_TRUE(says(error("groundtruth: {world: a}\nframes: {map: b}\n"), {"frames.T_map_world"}));
  EXPECT_TRUE(says(error("initial_pose:\n  p: [1, 2, 3]\n"), {"recording.yaml:1", "t_ns"}));
  EXPECT_TRUE(says(error("initial_pose: {t_ns: 0, p: [1, 2, 3], q_xyzw: [0, 0, 0, 2]}\n"), {"norm 2"}));
}

TEST(Recording, MissingFilesAreNamed) {
  const TemporaryFolder parent;
  EXPECT_TRUE(says(error_line(open_recording(parent / "none")), {"none", "no such recording folder"}));
  EXPECT_TRUE(says(error_line(open_recording(parent.file("file", ""))), {"is no recording"}));
  for (const char* name : {"events.h5", "camchain-imucam.yaml", "imu.yaml"}) {
    const std::string folder = Parts{}.write(parent);
    std::filesystem::remove(folder + "/" + name);
    EXPECT_TRUE(says(error_line(open_recording(folder)), {name, "no such file"}));
  }
}

TEST(Recording, PeerRecordingsOpen) {
  const std::string folder = shared_folder() + "/data/peer";
  EVPOSE_NEEDS_SHARED(folder);
  for (const char* name : {"room_spiral", "room_720p", "courtyard_landing", "room_people", "room_hover"}) {
    const auto r = open_recording(folder + "/" + name);
    ASSERT_TRUE(r.ok()) << error_line(r);
    EXPECT_TRUE(r->has_imu);
    EXPECT_GT(r->last_ns - r->first_ns, 9 * kNsPerS / 10) << name;
    EXPECT_GT(read_groundtruth(*r).value().size(), 900u);
  }
}

}  // namespace
}  // namespace evpose
