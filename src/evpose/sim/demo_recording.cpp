// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/demo_recording.h"

#include <algorithm>
#include <filesystem>
#include <numbers>
#include <sstream>
#include <system_error>
#include <vector>

#include "evpose/core/parallel.h"
#include "evpose/io/atomic_file.h"
#include "evpose/io/events_h5.h"
#include "evpose/io/imu_csv.h"
#include "evpose/io/ply.h"
#include "evpose/io/trajectory_tum.h"
#include "evpose/sim/event_pixels.h"
#include "evpose/sim/imu_sensor.h"
#include "evpose/sim/renderer.h"
#include "evpose/sim/scene_contours.h"

namespace evpose::sim {
namespace {

// Between two pictures the image moves by less than this: intensity is taken as linear there.
constexpr double kMotionPerPicture_px = 0.48;
constexpr double kLongestStep_s = 5e-3, kShortestStep_s = 1e-4;
constexpr double kContourSpacing_m = 0.01;
constexpr int kTruthRate_hz = 1000;

struct Rig {
  CameraIntrinsics intrinsics;
  Pose T_body_cam;
  ImuNoise imu;
};

Rig make_rig(ImageSize size) {
  Rig rig;
  const double focal = 0.596 * size.width;
  rig.intrinsics = {focal,
                    1.0008 * focal,
                    0.5 * size.width + 1.3,
                    0.5 * size.height - 1.8,
                    "radtan",
                    {-0.1, 0.02, 5e-4, -3e-4},
                    size};
  Eigen::Matrix3d axes;  // body: x forward, y left, z up; camera: x right, y down, z forward
  axes << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  const Eigen::Vector3d tilt = std::numbers::pi / 180 * Eigen::Vector3d(1.1, -1.4, 0.9);  // 2 degrees
  rig.T_body_cam = {Eigen::Quaterniond(axes) * so3::exp(tilt), {0.055, -0.02, 0.03}};
  rig.imu.rate_hz = 1000;
  return rig;
}

Status check(const DemoOptions& o) {
  const auto fits = [](int px) { return px >= 32 && px <= 4096; };
  if (!fits(o.size.width) || !fits(o.size.height))
    return Error{"demo size", text(o.size.width, " x ", o.size.height), "choose 32 to 4096 px each way"};
  if (!(o.duration_s >= 0.01 && o.duration_s <= 10))
    return Error{"demo duration", text(o.duration_s, " s"), "choose 0.01 to 10 s"};
  if (o.threads < 1) return Error{"demo threads", text(o.threads), "choose at least 1"};
  return {};
}

std::string list(std::initializer_list<double> values) {
  std::ostringstream out;
  out.precision(12);
  const char* separator = "[";
  for (const double v : values) {
    out << separator << v;
    separator = ", ";
  }
  out << "]";
  return out.str();
}

std::string camera_yaml(const Rig& rig) {
  const CameraIntrinsics& c = rig.intrinsics;
  const Eigen::Matrix4d T = rig.T_body_cam.inverse().matrix();
  std::string rows;
  for (int i = 0; i < 4; ++i) rows += "  - " + list({T(i, 0), T(i, 1), T(i, 2), T(i, 3)}) + "\n";
  return text(
      "cam0:\n  camera_model: pinhole\n  distortion_model: ", c.distortion_model,
      "\n  distortion_coeffs: ", list({c.distortion[0], c.distortion[1], c.distortion[2], c.distortion[3]}),
      "\n  intrinsics: ", list({c.fx, c.fy, c.cx, c.cy}), "\n  resolution: [", c.size.width, ", ",
      c.size.height, "]\n  rostopic: /events\n  T_cam_imu:\n", rows, "  timeshift_cam_imu: 0.0\n");
}

std::string imu_yaml(const ImuNoise& imu) {
  return text("accelerometer_noise_density: ", imu.accel_density,
              "\naccelerometer_random_walk: ", imu.accel_walk,
              "\ngyroscope_noise_density: ", imu.gyro_density, "\ngyroscope_random_walk: ", imu.gyro_walk,
              "\nrostopic: /imu\nupdate_rate: ", imu.rate_hz, "\n");
}

std::string scenario_yaml(const DemoOptions& o, const EventPixelConfig& pixels, const ImuErrors& errors) {
  return text("generator: evpose demo\nscene: box room\nmotion: square spiral\nseed: ", o.seed,
              "\nduration_s: ", o.duration_s, "\nmotion_per_picture_px: ", kMotionPerPicture_px,
              "\nevents:\n  threshold: ", pixels.threshold, "\n  threshold_spread: ", pixels.threshold_spread,
              "\n  refractory_s: ", pixels.refractory_s, "\n  stray_light: ", pixels.stray_light,
              "\n  shot_noise_hz: ", pixels.shot_noise_hz, "\n  hot_share: ", pixels.hot_share,
              "\n  hot_hz: ", list({pixels.hot_min_hz, pixels.hot_max_hz}),
              "\nimu:\n  gyro_bias_sigma: ", errors.gyro_bias, "\n  accel_bias_sigma: ", errors.accel_bias,
              "\n");
}

std::vector<TimedPose> truth(const Trajectory& trajectory, TimeNs duration) {
  std::vector<TimedPose> poses;
  for (TimeNs t = 0; t <= duration; t += kNsPerS / kTruthRate_hz)
    poses.push_back({t, trajectory.at(to_seconds(t)).T_map_body});
  return poses;
}

// The camera's own motion, in its frame.
double image_speed(const Renderer& renderer, const Frame& frame, const Motion& motion,
                   const Pose& T_body_cam) {
  const Eigen::Vector3d velocity_body =
      motion.T_map_body.q.conjugate() * motion.velocity + motion.rate.cross(T_body_cam.p);
  return renderer.image_speed(frame, T_body_cam.q.conjugate() * velocity_body,
                              T_body_cam.q.conjugate() * motion.rate);
}

Status write_events(const std::string& path, const Scene& scene, const Trajectory& trajectory, const Rig& rig,
                    const EventPixelConfig& config, const DemoOptions& options,
                    const std::function<void(double)>& progress) {
  const auto camera = make_camera(rig.intrinsics);
  EVPOSE_CHECK(camera.ok());
  auto writer = EventWriterH5::create(path, options.size, "evpose demo");
  if (!writer) return writer.error();
  const Renderer renderer(scene, **camera);
  ThreadPool pool(options.threads);
  EventPixels pixels(options.size, config, options.seed);
  Frame frame;
  EventPacket packet;
  const TimeNs end = from_seconds(options.duration_s);
  for (TimeNs t = 0;;) {
    const Motion motion = trajectory.at(to_seconds(t));
    renderer.render(motion.T_map_body * rig.T_body_cam, pool, frame);
    if (t == 0) {
      pixels.start(t, frame.radiance);
    } else {
      packet.events.clear();
      pixels.advance(t, frame.radiance, pool, packet);
      if (const Status written = writer->append(packet); !written) return written.error();
    }
    if (progress) progress(static_cast<double>(t) / static_cast<double>(end));
    if (t == end) return writer->finish();
    const double speed = image_speed(renderer, frame, motion, rig.T_body_cam);
    const double step_s = std::clamp(kMotionPerPicture_px / speed, kShortestStep_s, kLongestStep_s);
    t = std::min(end, t + from_seconds(step_s));
  }
}

}  // namespace

Status make_demo_recording(const std::string& folder, const DemoOptions& options,
                           const std::function<void(double)>& progress) {
  if (Status good = check(options); !good) return good;
  std::error_code failed;
  std::filesystem::create_directories(folder, failed);
  if (failed)
    return Error{folder, text("cannot be made: ", failed.message()), "choose a folder that can be written"};

  const Scene scene = make_box_room(options.seed);
  const Trajectory trajectory = make_square_spiral(options.seed);
  const Rig rig = make_rig(options.size);
  const EventPixelConfig pixels;
  const ImuErrors imu_errors;
  const TimeNs duration = from_seconds(options.duration_s);
  const ContourMap contours = make_contours(scene, kContourSpacing_m);
  const auto path = [&](const char* name) { return (std::filesystem::path(folder) / name).string(); };

  const std::function<Status()> steps[] = {
      [&] { return write_text_file(path("camchain-imucam.yaml"), camera_yaml(rig)); },
      [&] { return write_text_file(path("imu.yaml"), imu_yaml(rig.imu)); },
      [&] { return write_text_file(path("scenario.yaml"), scenario_yaml(options, pixels, imu_errors)); },
      [&] { return write_tum(path("groundtruth.tum"), truth(trajectory, duration)); },
      [&] {
        return write_imu_csv(path("imu.csv"),
                             simulate_imu(trajectory, duration, rig.imu, imu_errors, options.seed));
      },
      [&] { return write_ply_contours(path("contours.ply"), contours); },
      [&] { return write_ply_mesh(path("mesh.ply"), contours.occluders, contours.anchor); },
      [&] { return write_events(path("events.h5"), scene, trajectory, rig, pixels, options, progress); },
  };
  for (const auto& step : steps) {
    if (Status done = step(); !done) return done;
  }
  return {};
}

}  // namespace evpose::sim
