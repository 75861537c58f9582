// SPDX-License-Identifier: BSD-3-Clause
// Depth images of known poses, put together into a cloud that a map can be built from.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <memory>
#include <optional>
#include <thread>

#include "commands.h"
#include "evpose/core/log.h"
#include "evpose/core/parallel.h"
#include "evpose/eval/association.h"
#include "evpose/io/calibration/calibration.h"
#include "evpose/io/files/png_file.h"
#include "evpose/io/maps/ply.h"
#include "evpose/io/motion/trajectory.h"
#include "evpose/io/recording/depth_images.h"
#include "evpose/map_build/depth_fusion.h"
#include "evpose/run/progress.h"
#include "interrupt.h"

namespace evpose {
namespace {

struct DepthRequest {
  std::string folder, poses, calibration, output = "cloud.ply";
  double units_per_m = 1000;
  std::vector<double> noise;       ///< m, m / m^2
  std::vector<double> T_body_cam;  ///< x, y, z, qx, qy, qz, qw
  double voxel_m = 0.01, range_m = 5, max_gap_s = 0.2;
  int camera = -1, threads = 1;
  bool imu_poses = false;
};

/// An image and where it was taken.
struct PosedImage {
  std::string path;
  Pose T_map_cam;
};

struct DepthCamera {
  std::shared_ptr<const Camera> camera;
  Pose T_body_cam;  ///< body: that of the poses
};

Expected<Pose> body_pose(const DepthRequest& request, const CalibratedCamera& camera) {
  const auto& n = request.T_body_cam;
  if (request.imu_poses) {
    if (!n.empty()) return Error{"--imu-poses", "does not go with --T-body-cam", "give one of them"};
    if (!camera.T_cam_imu)
      return Error{request.calibration, "says nothing of where the IMU sits", "give --T-body-cam"};
    return camera.T_cam_imu->inverse();
  }
  if (n.empty()) return Pose();
  if (n.size() != 7)
    return Error{"--T-body-cam", text("has ", n.size(), " numbers"), "give X,Y,Z,QX,QY,QZ,QW"};
  const Eigen::Quaterniond q(n[6], n[3], n[4], n[5]);
  if (std::abs(q.norm() - 1) > 1e-2)
    return Error{"--T-body-cam", "has no unit quaternion", "give X,Y,Z,QX,QY,QZ,QW"};
  return Pose{q.normalized(), {n[0], n[1], n[2]}};
}

Expected<DepthCamera> read_camera(const DepthRequest& request) {
  const auto file = read_calibration(request.calibration);
  if (!file) return file.error();
  if (request.camera < 0 && file->cameras.size() > 1)
    return Error{request.calibration, text("has ", file->cameras.size(), " cameras"),
                 "name the depth camera's number with --camera, from 0"};
  const auto chosen = choose_camera(*file, std::max(request.camera, 0));
  if (!chosen) return chosen.error();
  auto camera = make_camera(*chosen->intrinsics);
  if (!camera) return camera.error();
  const auto T_body_cam = body_pose(request, *chosen);
  if (!T_body_cam) return T_body_cam.error();
  return DepthCamera{*std::move(camera), *T_body_cam};
}

Expected<map_build::DepthFusionConfig> config_of(const DepthRequest& request) {
  map_build::DepthFusionConfig config;
  if (!(request.units_per_m > 0 && request.units_per_m <= 1e6))
    return Error{"--scale", text(request.units_per_m, " is no number of units per metre"),
                 "give 1000 for millimetres, 5000 for TUM RGB-D"};
  config.noise.step_m = 1 / request.units_per_m;
  if (!request.noise.empty()) {
    if (request.noise.size() != 2 || !(request.noise[0] >= 0 && request.noise[1] >= 0) ||
        !(request.noise[0] + request.noise[1] > 0 && request.noise[0] + request.noise[1] <= 1))
      return Error{"--noise", "is no error of depth", "give A,B of A + B z^2, in metres, e.g. 0.0015,0.0025"};
    config.noise.least_m = request.noise[0], config.noise.growth_per_m = request.noise[1];
  }
  if (!(request.voxel_m >= 0.001 && request.voxel_m <= 1))
    return Error{"--voxel", text(request.voxel_m, " m is no size of a voxel"), "give 0.001 to 1 m"};
  constexpr double kMost_m = 1000;
  if (!(request.range_m > config.nearest_m && request.range_m <= kMost_m))
    return Error{"--range", text(request.range_m, " m is no range of a depth camera"),
                 text("give the largest depth to believe, ", config.nearest_m, " to ", kMost_m, " m")};
  config.voxel_m = request.voxel_m, config.farthest_m = request.range_m;
  return config;
}

/// The images whose pose is known; `left_out` counts the others.
Expected<std::vector<PosedImage>> place_images(const DepthRequest& request, const Pose& T_body_cam,
                                               std::size_t& left_out) {
  const auto images = list_depth_images(request.folder);
  if (!images) return images.error();
  const auto poses = read_trajectory(request.poses);
  if (!poses) return poses.error();
  std::vector<TimedPose> times;
  for (const DepthImageFile& image : *images) times.push_back({image.t, {}});
  AssociationOptions options;
  options.max_gap_s = request.max_gap_s;
  std::vector<PosedImage> out;
  for (const PosePair& pair : associate(times, *poses, options))
    out.push_back({(*images)[pair.index].path, pair.truth * T_body_cam});
  left_out = images->size() - out.size();
  if (out.empty())
    return Error{request.poses,
                 text("no depth image has a pose: images from ", to_seconds(images->front().t), " to ",
                      to_seconds(images->back().t), " s, poses from ", to_seconds(poses->front().t), " to ",
                      to_seconds(poses->back().t), " s"),
                 "check the clocks of both, or give a larger --max-gap"};
  return out;
}

/// Reads the images, a few at once, and adds them in their order. False: interrupted.
Expected<bool> fuse(const std::vector<PosedImage>& images, const Camera& camera,
                    const map_build::DepthFusionConfig& config, ThreadPool& pool,
                    map_build::DepthFusion& fusion) {
  const std::vector<Eigen::Vector3f> rays = map_build::rays_of_unit_depth(camera);
  const ImageSize size = camera.size();
  Progress progress("reading");
  const std::size_t batch = 2 * static_cast<std::size_t>(pool.threads());
  for (std::size_t first = 0; first < images.size(); first += batch) {
    const std::size_t count = std::min(batch, images.size() - first);
    std::vector<std::vector<map_build::DepthSample>> samples(count);
    std::vector<Status> read(count);
    pool.for_chunks(count, 1, [&](std::size_t k, std::size_t, std::size_t) {
      const std::string& path = images[first + k].path;
      const auto image = read_png_grey16(path);
      if (!image)
        read[k] = image.error();
      else if (ImageSize{image->width, image->height} != size)
        read[k] = Error{path,
                        text("is ", image->width, " x ", image->height, ", the calibration ", size.width,
                             " x ", size.height),
                        "give the calibration of the depth camera"};
      else
        samples[k] = map_build::samples_of({size, image->pixels}, rays, camera.focal_px(), config);
    });
    for (std::size_t k = 0; k < count; ++k) {
      if (!read[k]) return read[k].error();
      if (const Status added = fusion.add(samples[k], images[first + k].T_map_cam); !added)
        return added.error();
    }
    progress.at(static_cast<double>(first + count) / static_cast<double>(images.size()));
    if (InterruptGuard::interrupted()) return false;
  }
  return true;
}

double median_sigma_m(std::vector<MeasuredPoint> points) {
  const auto middle = points.begin() + static_cast<std::ptrdiff_t>(points.size() / 2);
  std::nth_element(points.begin(), middle, points.end(),
                   [](const MeasuredPoint& a, const MeasuredPoint& b) { return a.sigma_m < b.sigma_m; });
  return static_cast<double>(middle->sigma_m);
}

int make_cloud(const DepthRequest& request) {
  const auto config = config_of(request);
  if (!config) return bad_input(config.error());
  const auto camera = read_camera(request);
  if (!camera) return bad_input(camera.error());
  std::size_t left_out = 0;
  const auto images = place_images(request, camera->T_body_cam, left_out);
  if (!images) return bad_input(images.error());
  const InterruptGuard guard;
  ThreadPool pool(request.threads);
  map_build::DepthFusion fusion(*config);
  const auto fused = fuse(*images, *camera->camera, *config, pool, fusion);
  if (!fused) return bad_input(fused.error());
  if (!*fused) return kInterruptedStatus;
  const std::vector<MeasuredPoint> points = fusion.points(pool);
  if (points.empty())
    return bad_input({request.folder,
                      text("no pixel has a depth from ", config->nearest_m, " to ", config->farthest_m, " m"),
                      "check --scale and --range"});
  if (const Status done = write_ply_measured(request.output, points); !done) return bad_input(done.error());
  std::printf("images     %zu; %zu left out: no pose at their time\n", images->size(), left_out);
  std::printf("points     %zu, of %zu voxels of %.1f cm; median sigma %.1f mm\noutput     %s\n",
              points.size(), fusion.voxels(), 100 * config->voxel_m, 1e3 * median_sigma_m(points),
              request.output.c_str());
  std::printf("next       evpose map build %s", request.output.c_str());
  constexpr std::size_t kViewpoints = 8;
  for (const Eigen::Vector3d& eye : fusion.viewpoints(kViewpoints))
    std::printf(" --viewpoint %.2f,%.2f,%.2f", eye.x(), eye.y(), eye.z());
  std::printf("\n");
  return 0;
}

}  // namespace

void add_map_depth(CLI::App& map, std::function<int()>& run) {
  auto o = std::make_shared<DepthRequest>();
  o->threads = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  auto* depth = map.add_subcommand("depth", "Make a cloud of depth images whose poses are known");
  depth
      ->add_option("folder", o->folder,
                   "of the images, 16-bit PNG, and depth.txt: rows of `timestamp filename`, seconds")
      ->required();
  depth->add_option("--poses", o->poses, "of the depth camera in the map: TUM, or another trajectory")
      ->required();
  depth->add_option("--calibration", o->calibration, "of the depth camera, any kind that evpose info knows")
      ->required();
  depth->add_option("-o,--output", o->output, "cloud, PLY")->capture_default_str();
  depth->add_option("--scale", o->units_per_m, "units of the images per metre; TUM RGB-D: 5000")
      ->capture_default_str();
  depth->add_option("--camera", o->camera, "number of the depth camera in a calibration of several, from 0")
      ->check(CLI::Range(0, 1000));
  depth
      ->add_option("--T-body-cam", o->T_body_cam,
                   "X,Y,Z,QX,QY,QZ,QW: the depth camera in the body that the poses are of")
      ->delimiter(',');
  depth->add_flag("--imu-poses", o->imu_poses, "the poses are of the IMU, which the calibration places");
  depth->add_option("--noise", o->noise, "A,B: depth z errs by A + B z^2, m, 1 sigma; default: 0.0015,0.0025")
      ->delimiter(',');
  depth->add_option("--range", o->range_m, "largest depth that is believed, m")->capture_default_str();
  depth->add_option("--voxel", o->voxel_m, "side of a cube that has one point, m")->capture_default_str();
  depth->add_option("--max-gap", o->max_gap_s, "longest time between poses that is interpolated, s")
      ->capture_default_str();
  depth->add_option("--threads", o->threads, "that work; the cloud is the same for any number")
      ->capture_default_str()
      ->check(CLI::Range(1, 256));
  depth->callback([o, &run] { run = [o] { return make_cloud(*o); }; });
}

}  // namespace evpose
