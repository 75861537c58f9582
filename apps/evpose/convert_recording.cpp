// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <limits>

#include "convert_parts.h"
#include "evpose/io/bags/bag_writer.h"
#include "evpose/io/calibration/kalibr.h"
#include "evpose/io/files/new_folder.h"
#include "evpose/io/formats/create_event_writer.h"
#include "evpose/io/formats/open_events.h"
#include "evpose/io/motion/imu_csv.h"
#include "evpose/io/motion/trajectory_tum.h"
#include "evpose/io/recording/recording.h"
#include "interrupt.h"

namespace evpose {
namespace {

namespace fs = std::filesystem;

/// What a recording folder is made of, from whatever source.
struct Source {
  std::unique_ptr<EventReader> events;
  TimeNs first = 0;  ///< that the crop counts from
  std::vector<ImuSample> imu;
  std::vector<TimedPose> groundtruth;
  std::optional<CalibratedCamera> camera;
  std::optional<ImuNoise> noise;
  std::vector<std::string> copies;  ///< files that are taken as they are
  std::vector<std::string> missing;
  std::optional<Recording> recording;
};

/// With crop (on the clock of the input) and offset of the request added.
EventReadOptions cropped(EventReadOptions options, const Crop& crop, const ConvertRequest& request) {
  options.packet_s = 0.01;
  if (crop.begin) options.t_start_ns = std::max(crop.begin, options.t_start_ns);
  if (crop.end) options.t_end_ns = options.t_end_ns ? std::min(crop.end, options.t_end_ns) : crop.end;
  const TimeNs offset = from_seconds(request.offset_s);
  options.offset_ns += offset;
  if (options.t_start_ns) *options.t_start_ns += offset;
  if (options.t_end_ns) *options.t_end_ns += offset;
  return options;
}

Expected<Source> from_recording(const Recording& r, const ConvertRequest& request) {
  Source out;
  out.first = r.first_ns;
  out.recording = r;
  const Crop crop = crop_of(request, out.first);
  auto events = open_events(r.events_path, r.events_format, cropped(r.event_options, crop, request));
  if (!events) return events.error();
  out.events = *std::move(events);
  if (r.has_imu) {
    auto imu = open_imu(r);
    if (!imu) return imu.error();
    if (auto status = read_all(*std::move(imu), out.imu); !status) return status.error();
    out.noise = r.imu_noise;
  }
  if (!r.groundtruth_path.empty()) {
    auto truth = read_groundtruth(r);
    if (!truth) return truth.error();
    out.groundtruth = *std::move(truth);
  }
  if (r.groundtruth_path.empty() && fs::is_regular_file(request.input)) {
    SensorSink sink;
    sink.pose = [&](const TimedPose& pose) { out.groundtruth.push_back(pose); };
    if (auto status = read_sensors(request.input, "", sink); !status) return status.error();
  }
  CalibratedCamera camera;
  camera.intrinsics = r.camera;
  if (r.has_imu) camera.T_cam_imu = r.T_cam_body;
  out.camera = camera;  // without a shift: the events' stamps have it already
  for (const std::string& path : {r.contours_path, r.map_path})
    if (!path.empty()) out.copies.push_back(path);
  return out;
}

/// A file that is no recording for want of a calibration: what it holds, all the same.
Expected<Source> from_file(const ConvertRequest& request) {
  Source out;
  EventReadOptions options;
  options.topic = request.topic;
  auto probe = open_events(request.input, request.input_format, options);
  if (!probe) return probe.error();
  out.first = (*probe)->extent().first_ns;
  auto events = open_events(request.input, request.input_format,
                            cropped(options, crop_of(request, out.first), request));
  if (!events) return events.error();
  out.events = *std::move(events);
  SensorSink sink;
  sink.imu = [&](const ImuSample& sample) { out.imu.push_back(sample); };
  sink.pose = [&](const TimedPose& pose) { out.groundtruth.push_back(pose); };
  if (auto status = read_sensors(request.input, "", sink); !status) return status.error();
  out.missing.push_back("camchain-imucam.yaml: the input has no calibration; give it with --calibration");
  if (!out.imu.empty()) out.missing.push_back("imu.yaml: the noise of the IMU is not known");
  return out;
}

Expected<Source> open_source(const ConvertRequest& request) {
  const auto recording = open_recording(request.input, request.calibration);
  if (recording) return from_recording(*recording, request);
  if (!request.calibration.empty() || fs::is_directory(request.input)) return recording.error();
  return from_file(request);
}

Status write_rest(const NewFolder& folder, const std::string& place, const Source& source) {
  if (!source.imu.empty()) {
    for (std::size_t i = 1; i < source.imu.size(); ++i)
      if (source.imu[i].t <= source.imu[i - 1].t)
        return Error{place, text("IMU sample ", i, " does not come after the one before"),
                     "sort the samples and remove repeated ones"};
    if (auto status = write_imu_csv(folder.path("imu.csv"), source.imu); !status) return status;
  }
  if (source.noise)
    if (auto status = write_kalibr_imu(folder.path("imu.yaml"), *source.noise); !status) return status;
  if (source.camera)
    if (auto status = write_kalibr_camera(folder.path("camchain-imucam.yaml"), *source.camera); !status)
      return status;
  if (!source.groundtruth.empty())
    if (auto status = write_tum(folder.path("groundtruth.tum"), source.groundtruth); !status) return status;
  for (const std::string& path : source.copies) {
    std::error_code error;
    fs::copy_file(path, folder.path(fs::path(path).filename().string()), error);
    if (error) return Error{path, "cannot be copied: " + error.message(), "check the disk and the rights"};
  }
  return {};
}

/// A bag's events, and between them what else the source has, in order of time.
class BagOfAll : public EventWriter {
 public:
  BagOfAll(BagWriter bag, const Source& source) : bag_(std::move(bag)), source_(source) {}

  Status append(const EventPacket& packet) override {
    if (Status done = others_until(packet.base); !done) return done;
    return bag_.append(packet);
  }
  Status finish() override {
    if (Status done = others_until(std::numeric_limits<TimeNs>::max()); !done) return done;
    return bag_.finish();
  }

 private:
  Status others_until(TimeNs t) {
    const std::vector<ImuSample>& imu = source_.imu;
    const std::vector<TimedPose>& poses = source_.groundtruth;
    while (imu_ < imu.size() || pose_ < poses.size()) {
      const bool sample = pose_ == poses.size() || (imu_ < imu.size() && imu[imu_].t <= poses[pose_].t);
      if ((sample ? imu[imu_].t : poses[pose_].t) > t) return {};
      if (Status done = sample ? bag_.append(imu[imu_++]) : bag_.append(poses[pose_++]); !done) return done;
    }
    return {};
  }

  BagWriter bag_;
  const Source& source_;
  std::size_t imu_ = 0, pose_ = 0;
};

}  // namespace

Status read_all(ImuReader reader, std::vector<ImuSample>& out) {
  ImuSample sample;
  while (true) {
    const auto more = reader.next(sample);
    if (!more) return more.error();
    if (!*more) return {};
    out.push_back(sample);
  }
}

Expected<int> convert_to_bag(const ConvertRequest& request) {
  auto source = open_source(request);
  if (!source) return source.error();
  const ImageSize size = source->camera ? source->camera->intrinsics->size : source->events->size();
  // Only events, whose size has to be searched for.
  if (size == ImageSize{}) return convert_events(request);
  const auto filter = EventFilter::make(request, size);
  if (!filter) return filter.error();
  const Crop crop = crop_of(request, source->first);
  const TimeNs offset = from_seconds(request.offset_s);
  shift_and_crop(source->imu, crop, offset);
  shift_and_crop(source->groundtruth, crop, offset);
  auto bag = BagWriter::create(request.output, size, {.format = request.output_format});
  if (!bag) return bag.error();
  BagOfAll writer(*std::move(bag), *source);
  const auto written = write_events(request, *source->events, *filter, writer);
  if (!written) return written.error();
  if (!*written) return kInterruptedStatus;
  std::printf("%s: %lld events, %zu IMU samples, %zu poses\n", request.output.c_str(),
              static_cast<long long>((*written)->written), source->imu.size(), source->groundtruth.size());
  return 0;
}

Expected<int> convert_to_recording(const ConvertRequest& request) {
  auto source = open_source(request);
  if (!source) return source.error();
  std::error_code ignored;
  if (fs::exists(request.output, ignored) && !fs::is_empty(request.output, ignored))
    return Error{request.output, "exists already", "remove it or name another folder"};
  auto folder = NewFolder::create(request.output, "events.h5");
  if (!folder) return folder.error();
  ImageSize size = source->camera ? source->camera->intrinsics->size : source->events->size();
  ConvertRequest how = request;
  if (how.undistort) {
    // With the calibration that was found: it is written anyway.
    if (!source->camera)
      return Error{"--undistort", "there is no calibration", "give one with --calibration"};
    if (auto status = write_kalibr_camera(folder->path("camchain-imucam.yaml"), *source->camera); !status)
      return status.error();
    how.calibration = folder->path("camchain-imucam.yaml");
  }
  const auto filter = EventFilter::make(how, size);
  if (!filter) return filter.error();
  if (how.undistort) {
    source->camera->intrinsics->distortion_model = "none";
    source->camera->intrinsics->distortion.clear();
  }
  auto writer = create_event_writer(folder->path("events.h5"), "h5", size);
  if (!writer) return writer.error();
  const auto written = write_events(request, *source->events, *filter, **writer);
  if (!written) return written.error();
  if (!*written) return kInterruptedStatus;
  const Crop crop = crop_of(request, source->first);
  const TimeNs offset = from_seconds(request.offset_s);
  shift_and_crop(source->imu, crop, offset);
  shift_and_crop(source->groundtruth, crop, offset);
  if (auto status = write_rest(*folder, request.output, *source); !status) return status.error();
  const auto frames = how.undistort ? Expected<std::size_t>(0)
                                    : write_frames(*folder, request, source->recording, size, crop);
  if (!frames) return frames.error();
  if (auto status = folder->commit(); !status) return status.error();
  std::printf("%s: %lld events, %zu IMU samples, %zu poses, %zu frames\n", request.output.c_str(),
              static_cast<long long>((*written)->written), source->imu.size(), source->groundtruth.size(),
              *frames);
  for (const std::string& missing : source->missing) std::printf("missing: %s\n", missing.c_str());
  return 0;
}

}  // namespace evpose
