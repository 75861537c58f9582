// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/recording/recording_maker.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <future>
#include <optional>

#include "evpose/core/config.h"
#include "evpose/core/parallel.h"
#include "evpose/io/calibration/kalibr.h"
#include "evpose/io/events/event_truth_h5.h"
#include "evpose/io/events/events_h5.h"
#include "evpose/io/files/atomic_file.h"
#include "evpose/io/files/new_folder.h"
#include "evpose/io/maps/contour_files.h"
#include "evpose/io/motion/imu_csv.h"
#include "evpose/io/motion/trajectory_tum.h"
#include "evpose/sim/flight/flight_check.h"
#include "evpose/sim/light/scene_contours.h"
#include "evpose/sim/light/scene_view.h"
#include "evpose/sim/recording/world_cache.h"
#include "evpose/sim/world/scene_file.h"

namespace evpose::sim {
namespace {

namespace fs = std::filesystem;

constexpr const char* kScenarioFile = "scenario.yaml";

void switch_lamps(const LampConfig& lamps, Scene& scene) {
  LightSwitching switching;
  switching.off_at_s = lamps.off_at_s;
  switching.on_at_s = lamps.on_at_s;
  switching.off_factor = lamps.off_factor;
  switching.fade_s = 1e-3 * lamps.fade_ms;
  switching.flicker_hz = lamps.flicker_hz;
  switching.flicker_depth = lamps.flicker_hz > 0 ? lamps.flicker_depth : 0;
  if (switching.constant()) return;
  for (Light& light : scene.lights) {
    if (!light.daylight) light.switching = switching;
  }
}

Expected<Scene> make_scene(const Scenario& scenario, ThreadPool& pool) {
  auto scene = scenario.scene_file.empty() ? make_world(scenario.world, pool)
                                           : read_scene(scenario.scene_file, scenario.world, pool);
  if (scene) switch_lamps(scenario.lamps, *scene);
  return scene;
}

// Motion of the camera on the body.
CameraPath camera_path(const Trajectory& trajectory, const Pose& T_body_cam) {
  return [&trajectory, T_body_cam](double t_s) {
    const BodyMotion body = trajectory.at(t_s);
    const Eigen::Vector3d velocity_body =
        body.T_map_body.q.conjugate() * body.velocity + body.rate.cross(T_body_cam.p);
    return CameraMotion{body.T_map_body * T_body_cam, T_body_cam.q.conjugate() * velocity_body,
                        T_body_cam.q.conjugate() * body.rate};
  };
}

// Writes the delivered events and counts them.
class EventSink {
 public:
  static Expected<EventSink> create(const NewFolder& folder, ImageSize size, bool truth, const Scene& scene) {
    EventSink sink;
    auto events = EventWriterH5::create(folder.path("events.h5"), size, "evpose simulate");
    if (!events) return events.error();
    sink.events_.emplace(*std::move(events));
    if (!truth) return sink;
    auto truths = EventTruthWriter::create(folder.path("events_truth.h5"), scene.objects);
    if (!truths) return truths.error();
    sink.truths_.emplace(*std::move(truths));
    return sink;
  }

  Status write(const std::vector<SimEvent>& delivered, RecordingCounts& counts) {
    packet_.events.clear();
    for (const SimEvent& e : delivered) {
      if (packet_.empty()) packet_.base = e.t;
      packet_.events.push_back(
          make_event(static_cast<std::uint32_t>((e.t - packet_.base) / kNsPerUs), e.x, e.y, e.on));
      ++counts.by_cause[static_cast<std::size_t>(e.cause)];
      if (e.cause == EventCause::signal) ++counts.by_origin[static_cast<std::size_t>(e.origin)];
      if (!truths_) continue;
      const EventTruth truth{static_cast<std::uint8_t>(e.cause), static_cast<std::uint8_t>(e.origin),
                             e.object};
      if (Status done = truths_->append(truth); !done) return done;
    }
    return events_->append(packet_);
  }

  Status finish() {
    if (Status done = events_->finish(); !done) return done;
    return truths_ ? truths_->finish() : Status{};
  }

 private:
  std::optional<EventWriterH5> events_;
  std::optional<EventTruthWriter> truths_;
  EventPacket packet_;
};

bool has_contrast(const RayCaster& rays, const PreparedScene& prepared,
                  const std::vector<PixelRay>& pixel_rays, const Pose& pose) {
  constexpr std::size_t kEvery = 37;
  const SceneView view = make_scene_view(prepared, 0, pose);
  float low = std::numeric_limits<float>::infinity(), high = 0;
  for (std::size_t i = 0; i < pixel_rays.size(); i += kEvery) {
    const auto hit = rays.trace(pose.p, pose.q * pixel_rays[i].direction().cast<double>());
    const float value =
        hit ? luminance(prepared, view, make_patch_view(view, prepared.patch_of(*hit), -1), pixel_rays[i])
            : static_cast<float>(prepared.scene.sky_cd_m2);
    low = std::min(low, value);
    high = std::max(high, value);
  }
  return high > 0 && high > 1.01F * low;
}

class RecordingMaker {
 public:
  RecordingMaker(const Scenario& scenario, const NewFolder& folder, int threads,
                 std::function<void(double)> progress, const std::string& world_cache)
      : scenario_(scenario),
        folder_(folder),
        cache_(world_cache),
        pool_(threads),
        progress_(std::move(progress)) {}

  Expected<RecordingCounts> make();

 private:
  Status write_motion_and_calibration(const Trajectory& trajectory);
  /// With the errors of `handed_over`, and the truth beside it.
  Status write_calibration(CalibratedCamera truth) const;
  /// From `known`, or made and kept.
  Status write_map(const PreparedScene& prepared, const std::optional<WorldCache::World>& known);
  Status expose(const PreparedScene& prepared, const Camera& camera, const std::vector<PixelRay>& rays,
                const CameraPath& path);
  void report(double fraction) const {
    if (progress_) progress_(fraction);
  }

  const Scenario& scenario_;
  const NewFolder& folder_;
  WorldCache cache_;
  ThreadPool pool_;
  std::function<void(double)> progress_;
  RecordingCounts counts_;
};

Status RecordingMaker::write_motion_and_calibration(const Trajectory& trajectory) {
  const TimeNs end = from_seconds(counts_.duration_s);
  const Pose body_cam = T_body_cam(scenario_.camera);
  CalibratedCamera camera;
  camera.intrinsics = intrinsics(scenario_.camera);
  camera.T_cam_imu = body_cam.inverse();
  camera.has_timeshift = true;
  camera.timeshift_cam_imu_s = scenario_.imu.time_offset_s;
  // Poses are on the clock of the IMU, as those of the tracker are.
  const TimeNs delay = from_seconds(scenario_.imu.time_offset_s);
  std::vector<TimedPose> body, cam;
  for (std::int64_t k = 0;; ++k) {
    const TimeNs t = from_seconds(static_cast<double>(k) / scenario_.truth.rate_hz);
    if (t > end) break;
    const Pose pose = trajectory.at(to_seconds(t)).T_map_body;
    body.push_back({t + delay, pose});
    cam.push_back({t + delay, pose * body_cam});
  }
  Scenario all = scenario_;
  ConfigTable table;
  describe(table, all);
  if (Status done = write_text_file(folder_.path(kScenarioFile), table.to_yaml()); !done) return done;
  if (Status done = write_tum(folder_.path("groundtruth.tum"), body); !done) return done;
  if (Status done = write_tum(folder_.path("groundtruth_camera.tum"), cam); !done) return done;
  if (Status done = write_calibration(camera); !done) return done;
  const auto seed = static_cast<std::uint64_t>(scenario_.seed);
  ImuNoise imu = imu_noise(scenario_.imu);
  if (Status done = write_kalibr_imu(folder_.path("imu.yaml"), imu); !done) return done;
  const ImuErrors errors = draw_imu_errors(scenario_.imu, seed);
  imu.axes.gyro = errors.gyro_matrix, imu.axes.accel = errors.accel_matrix;
  if (Status done = write_kalibr_imu(folder_.path("imu_truth.yaml"), imu); !done) return done;
  return write_imu_csv(folder_.path("imu.csv"), simulate_imu(trajectory, end, scenario_.imu, seed));
}

Status RecordingMaker::write_calibration(CalibratedCamera truth) const {
  truth.sigma = CalibrationSigma::known(*truth.intrinsics);
  truth.trail_filter = {scenario_.read_out.trail, 1e-3 * scenario_.read_out.trail_ms};
  const std::string handed_over = folder_.path("camchain-imucam.yaml");
  const CalibrationErrors errors =
      draw_calibration_errors(scenario_.handed_over, static_cast<std::uint64_t>(scenario_.seed));
  if (errors.none()) return write_kalibr_camera(handed_over, truth);
  CalibratedCamera wrong = with_errors(truth, errors);
  wrong.sigma = stated_sigma(scenario_.handed_over, *truth.intrinsics);
  if (const auto camera = make_camera(*wrong.intrinsics); !camera)
    return Error{"handed_over", "the drawn errors make no camera", "take smaller sigmas or another seed"};
  if (Status done = write_text_file(folder_.path("handed_over.yaml"), to_yaml(errors)); !done) return done;
  if (Status done = write_kalibr_camera(folder_.path("camchain-imucam_truth.yaml"), truth); !done)
    return done;
  return write_kalibr_camera(handed_over, wrong);
}

Status RecordingMaker::write_map(const PreparedScene& prepared,
                                 const std::optional<WorldCache::World>& known) {
  WorldCache::World files;
  files.contours = folder_.path("contours.ply");
  files.mesh = folder_.path("mesh.ply");
  if (known) {
    counts_.contour_points = known->contour_points;
    std::error_code failed;
    if (fs::copy_file(known->contours, files.contours, failed) &&
        fs::copy_file(known->mesh, files.mesh, failed))
      return {};
    return Error{known->contours, failed.message(), "delete that folder: the world is then made anew"};
  }
  const double spacing_m = scenario_.truth.contour_spacing_m;
  const ContourMap contours = make_contours(prepared.scene, prepared.rays, spacing_m, pool_);
  counts_.contour_points = files.contour_points = contours.points.size();
  if (Status done = write_ply_contours(files.contours, contours); !done) return done;
  if (Status done = write_ply_mesh(files.mesh, contours.occluders, contours.anchor); !done) return done;
  return cache_.keep(prepared.scene, spacing_m, prepared.still, files);
}

Status RecordingMaker::expose(const PreparedScene& prepared, const Camera& camera,
                              const std::vector<PixelRay>& rays, const CameraPath& path) {
  const TimeNs end = from_seconds(counts_.duration_s);
  const std::vector<float> gain = lens_gain(scenario_.camera);
  auto sink = EventSink::create(folder_, camera.size(), scenario_.truth.events, prepared.scene);
  if (!sink) return sink.error();
  auto frames = FrameCamera::create(folder_, gain, camera.size(), scenario_.frames, end,
                                    static_cast<std::uint64_t>(scenario_.seed));
  if (!frames) return frames.error();
  EventPixels pixels(camera.size(), scenario_.events, static_cast<std::uint64_t>(scenario_.seed), gain);
  ReadOut read_out(camera.size(), scenario_.read_out, static_cast<std::uint64_t>(scenario_.seed));
  PixelIntegrator integrator(prepared, camera, rays, path, scenario_.integrator, pixels, pool_);
  integrator.start(0);
  std::vector<SimEvent> events, ready, delivered;
  // The events of a block are read out and written while the next block is made.
  std::future<Status> writing;
  for (TimeNs t = 0; t < end;) {
    events.clear();
    t = integrator.advance(end, frames->exposures(t, t + from_seconds(scenario_.integrator.block_s)), events);
    if (Status done = writing.valid() ? writing.get() : Status{}; !done) return done;
    std::swap(events, ready);
    writing = std::async(std::launch::async, [&, t]() -> Status {
      delivered.clear();
      read_out.push(ready, t, delivered);
      if (t == end) read_out.finish(delivered);
      return sink->write(delivered, counts_);
    });
    if (Status done = frames->write_finished(t); !done) return done;
    report(static_cast<double>(t) / static_cast<double>(end));
  }
  if (Status done = writing.valid() ? writing.get() : Status{}; !done) return done;
  counts_.read_out = read_out.counts();
  counts_.integrator = integrator.counts();
  counts_.frames = frames->written();
  if (Status done = frames->finish(); !done) return done;
  return sink->finish();
}

Expected<RecordingCounts> RecordingMaker::make() {
  TrajectoryConfig trajectory_config = scenario_.trajectory;
  trajectory_config.duration_s = scenario_.duration_s;
  const auto trajectory = make_trajectory(trajectory_config);
  if (!trajectory) return trajectory.error();
  counts_.duration_s = scenario_.duration_s;

  const auto camera = make_camera(intrinsics(scenario_.camera));
  if (!camera) return camera.error();
  const auto rays = pixel_rays(**camera, scenario_.camera.blur_px);
  if (!rays) return rays.error();
  const auto scene = make_scene(scenario_, pool_);
  if (!scene) return scene.error();

  const CameraPath path = camera_path(*trajectory, T_body_cam(scenario_.camera));
  const RayCaster caster(*scene);
  if (Status fine = check_flight(caster, path, counts_.duration_s, (*camera)->focal_px(),
                                 scenario_.integrator.max_flow_px_s);
      !fine)
    return fine.error();
  auto known = cache_.find(*scene, scenario_.truth.contour_spacing_m);
  const PreparedScene prepared(*scene, pool_, known ? std::move(known->light) : std::vector<LightMap>());
  if (!has_contrast(caster, prepared, *rays, path(0).T_map_cam))
    return Error{"scenario", "nothing in view has any contrast at the start",
                 "give the world light (world.lamp_lux, world.sun_lux) and texture (world.texture_contrast)"};

  const auto T_map_cam = [&](double t_s) { return path(t_s).T_map_cam; };
  if (Status done = write_motion_and_calibration(*trajectory); !done) return done.error();
  if (Status done = write_map(prepared, known); !done) return done.error();
  if (Status done = write_lidar(folder_.path("map_raw.ply"), caster, scenario_.lidar,
                                static_cast<std::uint64_t>(scenario_.seed), pool_);
      !done)
    return done.error();
  if (Status done = write_depth(folder_, prepared, *rays, (*camera)->size(), T_map_cam, scenario_.depth,
                                from_seconds(counts_.duration_s), pool_);
      !done)
    return done.error();
  if (Status done = expose(prepared, **camera, *rays, path); !done) return done.error();
  return counts_;
}

}  // namespace

Expected<RecordingCounts> make_recording(const Scenario& scenario, const std::string& folder, int threads,
                                         const std::function<void(double)>& progress,
                                         const std::string& world_cache) {
  const auto resolved = with_preset_values(scenario);
  if (!resolved) return resolved.error();
  auto temporary = NewFolder::create(folder, kScenarioFile);
  if (!temporary) return temporary.error();
  auto counts = RecordingMaker(*resolved, *temporary, threads, progress, world_cache).make();
  if (!counts) return counts;
  if (Status done = temporary->commit(); !done) return done.error();
  return counts;
}

}  // namespace evpose::sim
