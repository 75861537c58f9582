// SPDX-License-Identifier: BSD-3-Clause
// follow RECORDING MAP: tracks a recording that has ground truth, and prints each pose as it comes.
#include <cstdio>

#include "evpose/io/maps/contour_files.h"
#include "evpose/io/recording/recording.h"
#include "evpose/tracker/tracker.h"

using namespace evpose;

static Status follow(const char* recording_path, const char* map_path) {
  const auto recording = open_recording(recording_path);
  if (!recording) return recording.error();
  auto map = read_contour_map(map_path);
  if (!map) return map.error();
  const auto camera = make_camera(recording->camera);
  if (!camera) return camera.error();
  const auto truth = read_groundtruth(*recording);
  if (!truth) return truth.error();
  const TimedPose &a = truth->at(0), &b = truth->at(1);
  const StartState start{a.t, a.pose, (b.pose.p - a.pose.p) / to_seconds(b.t - a.t)};

  TrackerSetup setup;
  setup.camera = *camera;
  setup.intrinsics = recording->camera;
  setup.calibration_sigma = recording->calibration_sigma;
  setup.T_body_cam = recording->T_cam_body.inverse();
  setup.imu_noise = recording->imu_noise;
  setup.map = std::make_shared<const ContourMap>(std::move(*map));
  auto tracker = Tracker::create(setup, TrackerConfig{}, start);
  if (!tracker) return tracker.error();
  (*tracker)->on_update([](const Update& u) {
    const Eigen::Vector3d& p = u.T_map_body.p;
    std::printf("%.6f s  %.4f %.4f %.4f m  %s\n", to_seconds(u.t), p.x(), p.y(), p.z(), to_string(u.health));
  });

  auto events = open_events(*recording);
  auto imu = open_imu(*recording);
  if (!events || !imu) return events ? imu.error() : events.error();
  EventPacket packet;
  ImuSample sample;
  for (bool more = true; more;) {  // as they would come: IMU samples first, then the events up to them
    const auto got = (*events)->next(packet);
    if (!got || !*got) return got ? Status{} : Status(got.error());
    while (more && sample.t <= packet.time(packet.events.back())) {
      const auto next = imu->next(sample);
      if (!next) return next.error();
      if ((more = *next)) (*tracker)->add_imu(sample);
    }
    (*tracker)->add_events(packet);
  }
  return {};
}

int main(int argc, char** argv) {
  if (argc != 3) return std::fprintf(stderr, "follow RECORDING MAP\n"), 2;
  const Status done = follow(argv[1], argv[2]);
  return done ? 0 : (std::fprintf(stderr, "%s\n", done.error().line().c_str()), 2);
}
