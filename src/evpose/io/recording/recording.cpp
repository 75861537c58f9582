// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/recording/recording.h"

#include <sys/stat.h>

#include <algorithm>
#include <cmath>

#include "evpose/io/calibration/kalibr.h"
#include "evpose/io/files/numbers.h"
#include "evpose/io/formats/open_events.h"
#include "evpose/io/motion/imu_text.h"
#include "evpose/io/motion/imu_units.h"
#include "evpose/io/motion/trajectory.h"
#include "evpose/io/recording/dataset_layouts.h"

namespace evpose {
namespace {

constexpr double kOtherEpoch_s = 1e8;
constexpr const char* kJoinClocks =
    "set time.offset_events_s in recording.yaml (`evpose check` looks for it), "
    "or correct events.time_unit or imu.time_unit";

bool exists(const std::string& path) {
  struct stat info = {};
  return ::stat(path.c_str(), &info) == 0;
}

/// A file named in recording.yaml must be there; one of the default name may be absent (then "").
std::string optional_file(const std::string& folder, const std::optional<std::string>& named,
                          const char* usual) {
  const std::string path = folder + "/" + named.value_or(usual);
  return named || exists(path) ? path : "";
}

TimeNs to_ns(const std::optional<double>& seconds) { return seconds ? from_seconds(*seconds) : 0; }

std::string in_seconds(TimeNs t) { return format_decimal(t / kNsPerUs, 6) + " s"; }

Status take_files(const FoundRecording& found, Recording& r) {
  const RecordingOverrides& files = found.files;
  r.name = files.name;
  r.layout = found.layout;
  r.missing = found.missing;
  r.frames_path = files.frames ? r.folder + "/" + *files.frames : "";
  r.events_path = r.frames_path.empty() ? r.folder + "/" + files.events.value_or("events.h5")
                                        : optional_file(r.folder, files.events, "events.h5");
  r.calibration_path = r.folder + "/" +
                       (found.calibration_files.empty() ? files.calibration.value_or("camchain-imucam.yaml")
                                                        : found.calibration_files.front());
  r.imu_path = optional_file(r.folder, files.imu, "imu.csv");
  r.groundtruth_path = optional_file(r.folder, files.groundtruth, "groundtruth.tum");
  r.contours_path = optional_file(r.folder, files.contours, "contours.ply");
  r.map_path = optional_file(r.folder, files.map, "map.h5");
  r.has_imu = !r.imu_path.empty();
  if (r.has_imu) r.imu_model_path = optional_file(r.folder, files.imu_model, "imu.yaml");
  return {};
}

Status check_files(const Recording& r) {
  for (const std::string& path : {r.events_path, r.frames_path, r.calibration_path, r.imu_path,
                                  r.imu_model_path, r.groundtruth_path, r.contours_path, r.map_path}) {
    if (path.empty() || exists(path)) continue;
    // What the look at the folder said about it knows better where it comes from.
    for (const Error& missing : r.missing)
      if (missing.where == path || path == r.calibration_path) return missing;
    return Error{path, "no such file", "add it, or name another under files: in recording.yaml"};
  }
  return {};
}

/// The camera of a calibration file; one that does not say its size has that of the events.
Expected<CalibratedCamera> read_camera(const Recording& r, const RecordingOverrides& files,
                                       std::optional<ImuNoise>& noise) {
  auto calibration = read_calibration(r.calibration_path);
  if (!calibration) return calibration.error();
  noise = calibration->imu_noise;
  for (CalibratedCamera& camera : calibration->cameras) {
    if (!camera.intrinsics || camera.intrinsics->size != ImageSize{} || r.events_path.empty()) continue;
    const auto events = open_events(r.events_path, files.events_format, files.event_options);
    if (!events) return events.error();
    camera.intrinsics->size = (*events)->size();
  }
  return choose_camera(*calibration, files.camera_index);
}

Status take_calibration(const FoundRecording& found, Recording& r) {
  std::optional<ImuNoise> noise = found.imu_noise;
  auto camera = found.camera ? Expected<CalibratedCamera>(*found.camera) : read_camera(r, found.files, noise);
  if (!camera) return camera.error();
  r.camera = *camera->intrinsics;
  r.calibration_sigma = camera->sigma;
  r.trail_filter = camera->trail_filter;
  r.T_cam_body = camera->T_cam_imu.value_or(Pose{});
  r.timeshift_cam_imu_s = camera->timeshift_cam_imu_s;
  if (!r.has_imu) return {};
  if (!camera->T_cam_imu)
    return Error{r.calibration_path, text("no T_cam_imu for ", camera->name, ", but there is an IMU"),
                 "calibrate camera and IMU together, or remove " + r.imu_path + " to track without it"};
  if (!r.imu_model_path.empty()) {
    const auto read = read_imu_noise(r.imu_model_path);
    if (!read) return read.error();
    noise = *read;
  }
  if (!noise)
    return Error{r.folder + "/imu.yaml", "no such file: the noise of the IMU is not known",
                 "add it as Kalibr writes it, or name another under files: in recording.yaml"};
  r.imu_noise = *noise;
  return {};
}

/// Finds how the IMU is stored; what stands in one file with events is read as a whole.
Status take_imu(const RecordingOverrides& files, Recording& r) {
  r.imu_options = files.imu_options;
  if (!r.has_imu) return {};
  const bool is_text = r.imu_path.ends_with(".csv") || r.imu_path.ends_with(".txt");
  if (!is_text) {
    auto samples = std::make_shared<std::vector<ImuSample>>();
    SensorSink sink;
    sink.imu = [&](const ImuSample& sample) { samples->push_back(sample); };
    if (auto status = read_sensors(r.imu_path, files.imu_topic, sink); !status) return status;
    if (samples->empty()) return Error{r.imu_path, "holds no IMU samples", "set imu.topic, or record again"};
    r.imu_samples = std::move(samples);
    return {};
  }
  if (files.states_imu_layout || r.imu_path == r.folder + "/imu.csv") return {};
  const auto layout = recognise_imu_text(r.imu_path);
  if (!layout) return layout.error();
  r.imu_options.columns = layout->columns;
  r.imu_options.time_unit = layout->time_unit;
  return {};
}

Status take_groundtruth(const RecordingOverrides& overrides, const std::string& yaml, Recording& r) {
  r.groundtruth_offset_ns = to_ns(overrides.offset_groundtruth_s);
  if (overrides.groundtruth_body == "marker" && !overrides.T_body_imu)
    return Error{yaml, "groundtruth.body is marker, but groundtruth.T_body_imu is missing",
                 "give the transform from the IMU to the marker"};
  if (overrides.groundtruth_body != "imu") r.T_stored_body = overrides.T_body_imu.value_or(r.T_cam_body);
  if (overrides.T_map_world) r.T_map_world = *overrides.T_map_world;
  const bool named = !overrides.world_frame.empty() && !overrides.map_frame.empty();
  if (named && overrides.world_frame != overrides.map_frame && !overrides.T_map_world)
    return Error{yaml,
                 "groundtruth.world is '" + overrides.world_frame + "' and frames.map is '" +
                     overrides.map_frame + "', but frames.T_map_world is missing",
                 "give the transform from the world to the map"};
  return {};
}

void take_options(const RecordingOverrides& overrides, Recording& r) {
  r.events_format = overrides.events_format;
  r.event_options = overrides.event_options;
  r.event_options.offset_ns = from_seconds(r.timeshift_cam_imu_s) + to_ns(overrides.offset_events_s);
  if (overrides.t_start_s)
    r.event_options.t_start_ns = r.imu_options.t_start_ns = from_seconds(*overrides.t_start_s);
  if (overrides.t_end_s) r.event_options.t_end_ns = r.imu_options.t_end_ns = from_seconds(*overrides.t_end_s);
  r.frame_options = overrides.frame_options;
  r.frame_options.offset_ns = r.event_options.offset_ns;
  r.frame_options.t_start_ns = r.event_options.t_start_ns;
  r.frame_options.t_end_ns = r.event_options.t_end_ns;
  r.frame_options.size = r.camera.size;
  r.frame_camera = overrides.frame_camera;
  r.T_ned_map = overrides.T_ned_map;
  r.initial_pose = overrides.initial_pose;
}

/// Opens the events once: their size against the calibration's, and their span.
Status probe_events(Recording& r) {
  const auto reader = open_events(r.events_path, r.events_format, r.event_options);
  if (!reader) return reader.error();
  const ImageSize stated = (*reader)->size();
  if (stated != ImageSize{} && stated != r.camera.size)
    return Error{r.calibration_path,
                 text("resolution is ", r.camera.size.width, " x ", r.camera.size.height,
                      ", that of the events ", stated.width, " x ", stated.height),
                 "correct it, or set events.resolution in recording.yaml"};
  r.event_options.size = r.camera.size;
  const EventExtent extent = (*reader)->extent();
  r.first_ns = extent.first_ns;
  r.last_ns = extent.last_ns;
  r.event_count = extent.count;
  return {};
}

/// The list of frames; their span is that of the recording where there are no events.
Status probe_frames(Recording& r) {
  if (r.frames_path.empty()) return {};
  const auto reader = open_frames(r);
  if (!reader) return reader.error();
  if (!r.events_path.empty()) return {};
  if (reader->rows().empty()) return Error{r.frames_path, "no frames inside the crop", "choose other times"};
  r.first_ns = reader->rows().front().t;
  r.last_ns = reader->rows().back().t;
  return {};
}

/// What one pass over the IMU file tells.
struct ImuExtent {
  TimeNs first = 0, last = 0;
  ImuUnitCheck units;
  std::vector<ImuSample> start;  ///< for the comparison with the ground truth
};

constexpr std::size_t kMostCompared = 100'000;

Expected<ImuExtent> read_through(const Recording& r) {
  auto reader = open_imu(r);
  if (!reader) return reader.error();
  ImuExtent summary;
  ImuSample sample;
  while (true) {
    const auto more = reader->next(sample);
    if (!more) return more.error();
    if (!*more) break;
    if (summary.units.count() == 0) summary.first = sample.t;
    summary.last = sample.t;
    summary.units.add(sample);
    if (summary.start.size() < kMostCompared) summary.start.push_back(sample);
  }
  if (summary.units.count() < 2)
    return Error{r.imu_path,
                 text(summary.units.count(), " samples", r.imu_options.t_start_ns ? " inside the crop" : ""),
                 "record the IMU over the whole time, or remove the file"};
  return summary;
}

Status check_units(const Recording& r, const RecordingOverrides& overrides, const ImuExtent& summary) {
  // A stated unit is taken at its word.
  if (!overrides.states_accel_unit) {
    if (auto status = summary.units.check_accel(r.imu_path); !status) return status;
  }
  if (overrides.states_gyro_unit) return {};
  if (auto status = summary.units.check_gyro(r.imu_path); !status) return status;
  if (r.groundtruth_path.empty()) return {};
  const auto groundtruth = read_groundtruth(r);
  if (!groundtruth) return groundtruth.error();
  return check_gyro_against(*groundtruth, summary.start, r.imu_path);
}

Status check_overlap(const Recording& r, const ImuExtent& imu, bool has_offset) {
  const double apart = std::abs(to_seconds(r.first_ns - imu.first));
  if (apart > kOtherEpoch_s && !has_offset)
    return Error{r.imu_path,
                 text("the IMU starts at ", in_seconds(imu.first), ", the events at ", in_seconds(r.first_ns),
                      ": different epochs, they do not overlap"),
                 kJoinClocks};
  if (r.last_ns >= imu.first && r.first_ns <= imu.last) return {};
  return Error{r.imu_path,
               text("the IMU spans ", in_seconds(imu.first), " to ", in_seconds(imu.last), ", the events ",
                    in_seconds(r.first_ns), " to ", in_seconds(r.last_ns), ": they do not overlap"),
               kJoinClocks};
}

Status check_imu(const RecordingOverrides& overrides, Recording& r) {
  const auto imu = read_through(r);
  if (!imu) return imu.error();
  if (auto status = check_units(r, overrides, *imu); !status) return status;
  if (auto status = check_overlap(r, *imu, overrides.offset_events_s.has_value()); !status) {
    r.clocks_apart = status.error();
    return {};
  }
  r.first_ns = std::max(r.first_ns, imu->first);
  r.last_ns = std::min(r.last_ns, imu->last);
  return {};
}

Status crop(const std::string& yaml, Recording& r) {
  if (r.event_options.t_start_ns) r.first_ns = std::max(r.first_ns, *r.event_options.t_start_ns);
  if (r.event_options.t_end_ns) r.last_ns = std::min(r.last_ns, *r.event_options.t_end_ns);
  if (r.first_ns > r.last_ns)
    return Error{yaml, "time.t_start_s and time.t_end_s leave nothing of the recording",
                 "choose times inside it"};
  return {};
}

}  // namespace

Expected<Recording> open_recording(const std::string& path, const std::string& calibration) {
  auto recording = open_unjoined_recording(path, calibration);
  if (recording && recording->clocks_apart) return *recording->clocks_apart;
  return recording;
}

Expected<Recording> open_unjoined_recording(const std::string& path, const std::string& calibration) {
  auto found = find_recording(path);
  if (!found) return found.error();
  Recording r;
  r.folder = found->folder;
  const std::string yaml = r.folder + "/recording.yaml";
  if (auto status = take_files(*found, r); !status) return status.error();
  if (!calibration.empty()) {
    r.calibration_path = calibration;
    found->camera.reset();
    found->imu_noise.reset();
  }
  if (auto status = check_files(r); !status) return status.error();
  if (auto status = take_calibration(*found, r); !status) return status.error();
  if (auto status = take_groundtruth(found->files, yaml, r); !status) return status.error();
  if (auto status = take_imu(found->files, r); !status) return status.error();
  take_options(found->files, r);
  if (!r.events_path.empty())
    if (auto status = probe_events(r); !status) return status.error();
  if (auto status = probe_frames(r); !status) return status.error();
  if (auto status = crop(yaml, r); !status) return status.error();
  if (r.has_imu) {
    if (auto status = check_imu(found->files, r); !status) return status.error();
  }
  return r;
}

Expected<std::unique_ptr<EventReader>> open_events(const Recording& recording, double packet_s) {
  if (recording.events_path.empty())
    return Error{recording.folder, "has frames and no events", "give a recording with events"};
  EventReadOptions options = recording.event_options;
  options.packet_s = packet_s;
  return open_events(recording.events_path, recording.events_format, options);
}

Expected<FrameReader> open_frames(const Recording& recording) {
  EVPOSE_CHECK(!recording.frames_path.empty());
  return FrameReader::open(recording.frames_path, recording.frame_options);
}

Expected<ImuReader> open_imu(const Recording& recording) {
  EVPOSE_CHECK(recording.has_imu);
  if (recording.imu_samples)
    return ImuReader::of_samples(recording.imu_path, recording.imu_samples, recording.imu_options);
  return ImuReader::open(recording.imu_path, recording.imu_options);
}

Expected<std::vector<TimedPose>> read_groundtruth(const Recording& recording) {
  if (recording.groundtruth_path.empty())
    return Error{recording.folder + "/groundtruth.tum", "no such file: the recording has no ground truth",
                 "add it"};
  auto trajectory = read_trajectory(recording.groundtruth_path);
  if (!trajectory) return trajectory.error();
  for (TimedPose& row : *trajectory) {
    row.t += recording.groundtruth_offset_ns;
    row.pose = recording.T_map_world * row.pose;
    if (recording.T_stored_body) row.pose = row.pose * *recording.T_stored_body;
  }
  return trajectory;
}

}  // namespace evpose
