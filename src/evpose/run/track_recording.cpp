// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/run/track_recording.h"

#include <Eigen/Core>
#include <algorithm>
#include <filesystem>
#include <memory>

#include "evpose/camera/adjusted_camera.h"
#include "evpose/core/log.h"
#include "evpose/io/calibration/kalibr.h"
#include "evpose/io/files/config_yaml.h"
#include "evpose/io/maps/contour_files.h"
#include "evpose/io/maps/map_h5.h"
#include "evpose/io/maps/ply.h"
#include "evpose/io/motion/imu_units.h"
#include "evpose/io/recording/recording.h"
#include "evpose/report/overlay.h"
#include "evpose/run/kept_places.h"
#include "evpose/run/open_map.h"
#include "evpose/run/plausibility.h"
#include "evpose/run/presets.h"
#include "evpose/run/progress.h"
#include "evpose/run/start.h"

namespace evpose {
namespace {

constexpr std::size_t kUnitCheckSamples = 20'000;  // of the IMU, looked at before the run
constexpr std::size_t kDrawnMapPoints = 20'000;    // handed to the report
constexpr double kOverlayDecay_s = 0.02;
constexpr TimeNs kOverlayLead = 100 * kNsPerMs;  // a surface is kept so long before its picture

/// The first seconds of the IMU.
Expected<std::vector<ImuSample>> read_first_imu(const Recording& recording) {
  auto imu = open_imu(recording);
  if (!imu) return imu.error();
  std::vector<ImuSample> samples;
  ImuSample sample;
  while (samples.size() < kUnitCheckSamples) {
    const auto more = imu->next(sample);
    if (!more) return more.error();
    if (!*more) break;
    samples.push_back(sample);
  }
  return samples;
}

Status check_units(const std::vector<ImuSample>& samples, const Recording& recording,
                   const std::vector<TimedPose>& truth) {
  if (auto ok = check_imu_units(samples, recording.imu_path); !ok) return ok;
  return check_gyro_against(truth, samples, recording.imu_path);
}

/// Draws the map over the time surface at even intervals of the run, for the report.
class OverlayWriter {
 public:
  OverlayWriter(Tracker& tracker, RunFolder& run, TimeNs start, TimeNs end, int count)
      : tracker_(tracker), run_(run), start_(start), step_(count > 0 ? (end - start) / (count + 1) : 0) {}

  void add(const Update& u) {
    if (step_ <= 0) return;
    if (next_ == 0) next_ = start_ + step_;
    tracker_.keep_time_surface(u.t + kOverlayLead >= next_);
    if (u.t < next_) return;
    next_ += step_;
    const Snapshot s = tracker_.snapshot(kOverlayDecay_s);
    std::vector<OverlayPoint> points;
    for (const auto& p : s.points) points.push_back({p.x, p.y, p.matched});
    run_.add_overlay(text("t = ", 1e-3 * std::round(1e3 * to_seconds(u.t - start_)), " s"),
                     draw_overlay(s.size.width, s.size.height, s.decay, points));
  }

 private:
  Tracker& tracker_;
  RunFolder& run_;
  TimeNs start_, step_, next_ = 0;
};

/// The map of the run with the contrast that it has told, where the map lies in the world as before.
Status write_learnt_map(const std::string& path, const ContourMap& map, const Tracker& tracker) {
  const auto placement = read_map_placement(map.source);
  if (!placement) return placement.error();
  return write_map_h5(path, tracker.map_with_learnt_contrast(), "", *placement);
}

}  // namespace

Expected<std::string> map_path(const TrackRequest& request, const Recording& recording) {
  if (!request.map.empty()) return request.map;
  const std::string& own = recording.map_path.empty() ? recording.contours_path : recording.map_path;
  if (own.empty()) return Error{recording.folder, "the recording holds no map", "give one with --map"};
  return own;
}

Expected<std::shared_ptr<const ContourMap>> load_map(const TrackRequest& request,
                                                     const Recording& recording) {
  const auto path = map_path(request, recording);
  if (!path) return path.error();
  auto map = read_contour_map(*path);
  if (!map) return map.error();
  if (!request.occluders.empty()) {
    auto mesh = read_ply_mesh(request.occluders, map->anchor);
    if (!mesh) return mesh.error();
    map->occluders = std::move(*mesh);
  }
  return std::make_shared<const ContourMap>(std::move(*map));
}

void describe(ConfigTable& table, RunConfig& c) {
  describe(table, c.tracker);
  table.add("packet_ms", c.packet_ms, "ms", "length of the packets in which events are read", {1e-3, 1e5});
  table.add("states_imu", c.states_imu, "write states_imu.csv: the state at each IMU sample");
  table.add("overlays", c.overlays, "", "pictures of the map over the time surface in the report", {0, 100});
}

Expected<RunConfig> load_config(const TrackRequest& request) {
  RunConfig config;
  ConfigTable table;
  describe(table, config);
  if (auto ok = apply_preset(table, request.preset); !ok) return ok.error();
  if (auto ok = apply_settings(table, request.config_file, request.assignments); !ok) return ok.error();
  return config;
}

namespace {

/// By place, if the file can be read so and nothing asks for all of the map.
Expected<OpenedMap> open_map_of(const TrackRequest& request, const RunConfig& config,
                                const Recording& recording, const Eigen::Vector3d& start_map) {
  if (!request.occluders.empty() || !request.learnt_map.empty() || starts_anywhere(request.init)) {
    const auto map = load_map(request, recording);
    if (!map) return map.error();
    return OpenedMap{*map, {}};
  }
  const auto path = map_path(request, recording);
  return path ? open_map(*path, start_map, config.tracker) : path.error();
}

Eigen::Vector3d middle_of(const ContourMap& map) {
  Eigen::AlignedBox3f box;
  for (const ContourPoint& p : map.points) box.extend(p.position);
  return box.isEmpty() ? map.anchor : Eigen::Vector3d(map.anchor + box.center().cast<double>());
}

/// A recording of frames alone is tracked by them.
Status choose_frame_use(const Recording& recording, FrameUse& use) {
  if (recording.frames_path.empty() && use == FrameUse::alone)
    return Error{recording.folder, "has no frames, which frames.use=alone asks for",
                 "put frames/timestamps.csv there, or name a list under files.frames in recording.yaml"};
  if (!recording.events_path.empty()) return {};
  if (use == FrameUse::off)
    return Error{recording.folder, "has frames and no events, and frames.use is off",
                 "leave frames.use as it is"};
  use = FrameUse::alone;
  return {};
}

}  // namespace

Expected<TrackJob> make_job(const TrackRequest& request, const RunConfig& config, const Recording& recording,
                            std::vector<TimedPose> truth) {
  auto camera = make_camera(recording.camera);
  if (!camera) return Error{recording.calibration_path, camera.error().what, camera.error().fix};
  TrackJob job;
  job.config = config;
  if (auto status = choose_frame_use(recording, job.config.tracker.frames.use); !status)
    return status.error();
  const auto path = map_path(request, recording);
  if (!path) return path.error();
  const auto placement = read_map_placement(*path);
  if (!placement) return placement.error();
  auto start = choose_start(request.init, recording, truth, {request.init_sigma[0], request.init_sigma[1]},
                            *placement, &job.config.tracker.fusion);
  if (!start) return start.error();
  const auto map = open_map_of(request, job.config, recording, start->T_map_body.p);
  if (!map) return map.error();
  if (starts_anywhere(request.init)) start->T_map_body.p = middle_of(*map->map);
  job.recording = recording;
  job.map = map->map;
  job.truth = std::move(truth);
  job.start = *start;
  job.setup = {*camera,
               recording.T_cam_body.inverse(),
               recording.has_imu ? MotionModel::imu : MotionModel::constant_velocity,
               recording.imu_noise,
               map->map,
               recording.camera,
               recording.calibration_sigma,
               recording.trail_filter,
               map->parts,
               start->T_map_body.p,
               recording.frame_camera};
  if (request.occluders.empty() && !map->parts) {
    auto places = kept_places(*path, *map->map, job.findings);
    if (!places) return places.error();
    job.setup.places = *std::move(places);
  }
  job.start_words = start_words(request.init, !job.truth.empty());
  for (const auto& doubt : {doubt_map_size(*map->map), doubt_start_place(*map->map, start->T_map_body)})
    if (doubt) job.findings.push_back(*doubt);
  return job;
}

Expected<TrackJob> prepare(const TrackRequest& request, const RunConfig& config) {
  auto recording = open_recording(request.recording, request.calibration);
  if (!recording) return recording.error();
  if (!request.imu_model.empty()) {
    const auto imu = read_imu_noise(request.imu_model);
    if (!imu) return imu.error();
    recording->imu_noise = *imu;
  }
  std::vector<TimedPose> truth;
  if (!recording->groundtruth_path.empty()) {
    auto read = read_groundtruth(*recording);
    if (!read) return read.error();
    truth = std::move(*read);
  }
  std::vector<ImuSample> imu;
  if (recording->has_imu) {
    auto read = read_first_imu(*recording);
    if (!read) return read.error();
    imu = std::move(*read);
    if (auto ok = check_units(imu, *recording, truth); !ok) return ok.error();
  }
  auto job = make_job(request, config, *recording, std::move(truth));
  if (!job) return job;
  if (starts_anywhere(request.init) || starts_by_gps(request.init))
    if (const auto up = up_by_accelerometer(imu, job->start.t))
      job->start.T_map_body.q = Eigen::Quaterniond::FromTwoVectors(*up, Eigen::Vector3d::UnitZ());
  for (const Error& doubt : doubt_imu(imu, job->truth, job->start, recording->imu_path))
    job->findings.push_back(doubt);
  return job;
}

Error nothing_compared(const TrackJob& job, const Tracker& tracker) {
  const std::string finding = job.findings.empty() ? "" : job.findings.front().line() + "; ";
  if (tracker.searching())
    return {"start pose", "was not found where it was searched",
            finding + "check map and calibration; a better --init makes the search smaller"};
  if (tracker.aligns_start())
    return {job.recording.calibration_path,
            "at no errors that its sigmas allow do the contours of the first view lie on the events",
            finding + "check --init, map and calibration; give one that is nearer, or larger sigmas"};
  return {job.map->source, text("none of the map's ", job.map->points.size(), " points ever comes into view"),
          finding + "check the map's frame, the start pose and the extrinsics T_cam_imu"};
}

std::optional<RunCalibration> run_calibration(const TrackJob& job, const Calibration& found) {
  const Recording& recording = job.recording;
  RunCalibration out;
  CalibratedCamera& given = out.given;
  given.name = "cam0";
  given.intrinsics = recording.camera;
  given.trail_filter = recording.trail_filter;
  given.has_timeshift = recording.has_imu;
  given.timeshift_cam_imu_s = recording.timeshift_cam_imu_s;
  if (recording.has_imu) given.T_cam_imu = recording.T_cam_body;
  const CalibrationSigma& stated = recording.calibration_sigma;
  const Eigen::VectorXd numbers = stated.of_intrinsics(recording.camera);
  const auto of_numbers = [](const Eigen::VectorXd& sigma, CalibrationSigma& to) {
    to.intrinsics.emplace(sigma.begin(), sigma.begin() + 4);
    to.distortion.emplace(sigma.begin() + 4, sigma.end());
  };
  of_numbers(numbers, given.sigma);
  if (recording.has_imu) {
    given.sigma.rotation_rad = stated.of_rotation_rad();
    given.sigma.translation_m = stated.of_translation_m();
    given.sigma.time_s = stated.of_time_s();
  }
  out.found = given;
  CalibratedCamera& known = out.found;
  if (found.intrinsics.size() > 0) {
    known.intrinsics = corrected(*known.intrinsics, found.intrinsics);
    of_numbers(found.intrinsics_sigma, known.sigma);
  }
  if (recording.has_imu) {
    const Pose T_body_cam{found.turn * job.setup.T_body_cam.q, job.setup.T_body_cam.p + found.shift};
    known.T_cam_imu = T_body_cam.inverse();
    known.timeshift_cam_imu_s += found.time_offset_s;
    known.sigma.rotation_rad = found.turn_sigma_rad;
    known.sigma.translation_m = found.shift_sigma_m;
    known.sigma.time_s = found.time_sigma_s;
  }
  const bool estimated = found.intrinsics.size() > 0 || found.time_sigma_s > 0 ||
                         found.turn_sigma_rad.norm() > 0 || found.shift_sigma_m.norm() > 0;
  return estimated ? std::optional(out) : std::nullopt;
}

namespace {

/// Empty stays empty.
std::string absolute(const std::string& path) {
  return path.empty() ? path : std::filesystem::absolute(path).lexically_normal().string();
}

}  // namespace

RunSummary summarise(const TrackJob& job, const TrackRequest& request, const Tracker& tracker,
                     const Calibration& found) {
  const Recording& recording = job.recording;
  const ContourMap& map = *job.map;
  RunSummary summary;
  summary.input = {absolute(request.recording), absolute(map.source), absolute(recording.calibration_path),
                   absolute(request.occluders)};
  summary.title = recording.name;
  const auto name = [](const std::string& path) { return path.substr(path.find_last_of('/') + 1); };
  summary.subtitle = text("map ", name(map.source), " (", map.points.size(),
                          map.numbers.empty() ? " points" : " points around the start",
                          map.occluders.triangles.empty() ? "" : ", with occluders",
                          "), start: ", request.init, recording.has_imu ? "" : ", no IMU");
  summary.start = job.start_words;
  summary.findings = job.findings;
  summary.calibration = run_calibration(job, found);
  summary.T_body_cam = job.setup.T_body_cam;
  if (summary.calibration && summary.calibration->found.T_cam_imu)
    summary.T_body_cam = summary.calibration->found.T_cam_imu->inverse();
  summary.truth = job.truth;
  const std::size_t step = map.points.size() / kDrawnMapPoints + 1;
  for (std::size_t i = 0; i < map.points.size(); i += step) summary.map_points.push_back(map.position(i));
  const auto& counts = tracker.events().counts();
  summary.events_read = static_cast<std::uint64_t>(counts.read);
  summary.events_kept = static_cast<std::uint64_t>(counts.kept);
  summary.events_shed = static_cast<std::uint64_t>(counts.shed);
  for (const auto& p : tracker.events().noise_filter().hot_pixels())
    summary.hot_pixels.emplace_back(p.x, p.y);
  summary.versions = {
      {"compiler", __VERSION__},
      {"eigen", text(EIGEN_WORLD_VERSION, ".", EIGEN_MAJOR_VERSION, ".", EIGEN_MINOR_VERSION)}};
  return summary;
}

Expected<RunOutcome> track_recording(const TrackRequest& request) {
  const auto asked = load_config(request);
  if (!asked) return asked.error();
  auto job = prepare(request, *asked);
  if (!job) return job.error();
  RunConfig& config = job->config;
  auto run = RunFolder::create(request.output, request.replace);
  if (!run) return run.error();
  auto tracker = Tracker::create(job->setup, config.tracker, job->start, wall_s);
  if (!tracker) return tracker.error();
  for (const Error& finding : job->findings) log_warning(finding.line());
  int most_points = 0;
  std::int64_t updates = 0;
  OverlayWriter overlays(**tracker, *run, job->start.t, job->recording.last_ns, config.overlays);
  (*tracker)->on_update([&](const Update& u) {
    run->add(u);
    run->add_calibration(u.t, (*tracker)->calibration());
    ++updates;
    most_points = std::max(most_points, u.points);
    overlays.add(u);
  });
  if (config.states_imu) (*tracker)->on_state([&](const FusionState& s) { run->add_state(s); });

  const double wall_start = wall_s(), cpu_start = cpu_s();
  Progress progress("tracking");
  bool interrupted = false;
  const auto go_on = [&](double share) {
    progress.at(share);
    interrupted = request.interrupted && request.interrupted();
    return !interrupted;
  };
  if (auto ok = feed_recording(job->recording, config, **tracker, go_on); !ok) return ok.error();
  progress.done();
  if (updates == 0)
    return Error{request.recording, "the streams end before the first update",
                 "check that events and IMU cover the start"};
  if (most_points == 0 && !interrupted) return nothing_compared(*job, **tracker);
  if (!request.learnt_map.empty())
    if (auto ok = write_learnt_map(request.learnt_map, *job->map, **tracker); !ok) return ok.error();

  RunSummary summary = summarise(*job, request, **tracker, (*tracker)->calibration());
  summary.interrupted = interrupted;
  summary.wall_s = wall_s() - wall_start;
  summary.cpu_s = cpu_s() - cpu_start;
  summary.peak_memory_mb = peak_memory_mb();
  ConfigTable table;
  describe(table, config);
  return run->finish(summary, table);
}

}  // namespace evpose
