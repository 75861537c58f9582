// SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "commands.h"
#include "convert_parts.h"
#include "evpose/io/calibration/calibration.h"
#include "evpose/io/calibration/kalibr.h"
#include "evpose/io/motion/imu_csv.h"
#include "evpose/io/motion/imu_text.h"
#include "evpose/io/motion/trajectory.h"
#include "evpose/io/motion/trajectory_tum.h"
#include "evpose/io/recording/recording.h"
#include "evpose/report/run_messages.h"
#include "input_kind.h"
#include "interrupt.h"

namespace evpose {
namespace {

bool ends_with_any(const std::string& path, std::initializer_list<const char*> endings) {
  return std::any_of(endings.begin(), endings.end(), [&](const char* e) { return path.ends_with(e); });
}

/// A folder: no extension, or a slash at the end.
bool names_folder(const std::string& path) {
  return path.ends_with('/') || !std::filesystem::path(path).has_extension();
}

/// Holds more than events.
bool names_bag(const ConvertRequest& r) {
  if (!r.output_format.empty()) return r.output_format == "rosbag1" || r.output_format == "mcap";
  return r.output.ends_with(".bag") || r.output.ends_with(".mcap");
}

/// Writing over what is being read would destroy it.
Status check_output(const ConvertRequest& r) {
  std::error_code ignored;
  if (std::filesystem::equivalent(r.input, r.output, ignored))
    return Error{r.output, "is the input itself", "name another output"};
  const auto in = std::filesystem::weakly_canonical(r.input, ignored);
  const auto out = std::filesystem::weakly_canonical(r.output, ignored);
  if (std::filesystem::is_directory(in, ignored) && out.string().starts_with(in.string() + "/"))
    return Error{r.output, "lies inside the input", "name a place outside of " + r.input};
  if (r.undistort && r.calibration.empty() && !names_folder(r.output))
    return Error{"--undistort", "there is no calibration", "give one with --calibration"};
  return {};
}

/// Of a recording only the events go into a single file.
Expected<int> convert_events_of_recording(ConvertRequest request) {
  const auto found = open_recording(request.input, request.calibration);
  if (!found) return found.error();
  if (request.calibration.empty()) request.calibration = found->calibration_path;
  request.offset_s += to_seconds(found->event_options.offset_ns);  // to the IMU's clock
  request.input = found->events_path;
  request.input_format = found->events_format;
  return convert_events(request);
}

/// Foxglove's view of a run.
Expected<int> convert_run(const ConvertRequest& request) {
  if (!request.output.ends_with(".mcap"))
    return Error{request.output, "a run cannot be written so", "use an output that ends in .mcap"};
  const auto run = read_run_files(request.input);
  if (!run) return run.error();
  const auto written = write_run_mcap(request.output, *run);
  if (!written) return written.error();
  std::printf("%s: %zu poses, %zu map points, %zu pictures\n", request.output.c_str(), written->poses,
              written->map_points, written->pictures);
  if (!written->without.empty()) std::printf("without pictures: %s\n", written->without.c_str());
  return 0;
}

Expected<int> convert(const ConvertRequest& request) {
  if (auto status = check_output(request); !status) return status.error();
  if (is_run_folder(request.input)) return convert_run(request);
  const auto kind = kind_of_input(request.input);
  if (!kind) return kind.error();
  switch (*kind) {
    case InputKind::recording:
      if (request.output_format == "euroc") return convert_to_euroc(request);
      return names_folder(request.output) ? convert_to_recording(request)
             : names_bag(request)         ? convert_to_bag(request)
                                          : convert_events_of_recording(request);
    case InputKind::events:
      return names_folder(request.output) ? convert_to_recording(request)
             : names_bag(request)         ? convert_to_bag(request)
                                          : convert_events(request);
    case InputKind::trajectory:
      return convert_trajectory(request);
    case InputKind::imu:
      return convert_imu(request);
    case InputKind::calibration:
      return convert_calibration(request);
    case InputKind::map:
      break;
  }
  return Error{request.input, "is a map", "use evpose map import"};
}

Error unknown_output(const std::string& path, const std::string& what, const std::string& endings) {
  return {path, what + " cannot be written so", "use an output that ends in " + endings};
}

}  // namespace

Expected<int> convert_trajectory(const ConvertRequest& request) {
  auto poses = read_trajectory(request.input);
  if (!poses) return poses.error();
  if (!request.pose_of.empty()) {
    if (request.calibration.empty())
      return Error{"--pose-of", "needs to know where it sits on the IMU", "give --calibration"};
    const auto file = read_calibration(request.calibration);
    if (!file) return file.error();
    std::optional<Pose> T_body_imu;
    if (request.pose_of == "camera") {
      const auto camera = choose_camera(*file);
      if (!camera) return camera.error();
      T_body_imu = camera->T_cam_imu;
    } else {
      for (const NamedTransform& t : file->transforms)
        if (t.name == "T_imu_marker") T_body_imu = t.pose.inverse();
    }
    if (!T_body_imu)
      return Error{request.calibration, "does not tell where the " + request.pose_of + " sits on the IMU",
                   "give a file with T_cam_imu (camera) or T_imu_marker (marker)"};
    for (TimedPose& row : *poses) row.pose = row.pose * *T_body_imu;
  }
  const Crop crop = crop_of(request, poses->front().t);
  std::erase_if(*poses, [&](const TimedPose& row) { return !crop.holds(row.t); });
  if (poses->empty()) return Error{request.input, "no poses are left to be written", "widen the crop"};
  for (TimedPose& row : *poses) row.t += from_seconds(request.offset_s);
  const bool euroc = request.output.ends_with(".csv");
  if (!euroc && !ends_with_any(request.output, {".tum", ".txt"}))
    return unknown_output(request.output, "a trajectory", ".tum or .txt (TUM), or .csv (EuRoC)");
  const Status written = euroc ? write_euroc(request.output, *poses) : write_tum(request.output, *poses);
  if (!written) return written.error();
  std::printf("%s: %zu poses\n", request.output.c_str(), poses->size());
  return 0;
}

Expected<int> convert_imu(const ConvertRequest& request) {
  if (!request.output.ends_with(".csv"))
    return unknown_output(request.output, "IMU samples", ".csv (imu.csv)");
  auto layout = recognise_imu_text(request.input);
  if (!layout) return layout.error();
  layout->max_gap_s = 1e9;
  auto samples = read_imu_csv(request.input, *layout);
  if (!samples) return samples.error();
  if (samples->empty()) return Error{request.input, "holds no samples", "record again"};
  const Crop crop = crop_of(request, samples->front().t);
  std::erase_if(*samples, [&](const ImuSample& s) { return !crop.holds(s.t); });
  for (ImuSample& s : *samples) s.t += from_seconds(request.offset_s);
  if (auto status = write_imu_csv(request.output, *samples); !status) return status.error();
  std::printf("%s: %zu IMU samples\n", request.output.c_str(), samples->size());
  return 0;
}

Expected<int> convert_calibration(const ConvertRequest& request) {
  if (!ends_with_any(request.output, {".yaml", ".yml"}))
    return unknown_output(request.output, "a calibration", ".yaml (Kalibr)");
  const auto file = read_calibration(request.input);
  if (!file) return file.error();
  if (file->cameras.empty() && file->imu_noise) {
    if (auto status = write_kalibr_imu(request.output, *file->imu_noise); !status) return status.error();
    std::printf("%s: IMU noise\n", request.output.c_str());
    return 0;
  }
  const auto camera = choose_camera(*file);
  if (!camera) return camera.error();
  if (auto status = write_kalibr_camera(request.output, *camera); !status) return status.error();
  std::printf("%s: %s as cam0%s\n", request.output.c_str(), camera->name.c_str(),
              camera->T_cam_imu ? "" : ", without its place on the IMU");
  return 0;
}

void add_convert(CLI::App& app, std::function<int()>& run) {
  auto* command = app.add_subcommand(
      "convert", "Write events, recordings, trajectories, calibrations or runs in another format");
  auto request = std::make_shared<ConvertRequest>();
  ConvertRequest& r = *request;
  command->add_option("input", r.input, "anything that evpose info knows, but maps")->required();
  command
      ->add_option("output", r.output,
                   "by its ending: .h5, .raw (EVT3), .txt, .csv: events; .tum, .txt: trajectory; .csv: IMU; "
                   ".yaml: calibration as Kalibr's; .mcap: bag, of a run for Foxglove; without ending: "
                   "recording folder")
      ->required();
  const auto seconds = CLI::Range(-4e9, 4e9);
  command->add_option("--start", r.start_s, "leave out what is earlier; from the first stamp [s]")
      ->check(seconds);
  command->add_option("--end", r.end_s, "leave out what is later; from the first stamp [s]")->check(seconds);
  command->add_option("--duration", r.duration_s, "length from the start [s]")->check(CLI::Range(0.0, 4e9));
  command->add_option("--offset", r.offset_s, "added to all stamps [s]")->check(seconds);
  command
      ->add_option("--region", r.region,
                   "x0,y0,x1,y1: keep only these pixels, the last two excluded; coordinates stay")
      ->delimiter(',')
      ->expected(4);
  command->add_option("--size", r.size, "width,height of the image, where the input does not say it")
      ->delimiter(',')
      ->expected(2)
      ->check(CLI::Range(1, 32767));
  command->add_option("--polarity", r.polarity, "keep only these events")
      ->check(CLI::IsMember({"on", "off"}));
  command->add_flag("--undistort", r.undistort,
                    "move events to where a lens without distortion had put them, to the nearest pixel");
  command->add_option("--calibration", r.calibration, "calibration file of any kind that evpose info knows");
  command->add_option("--pose-of", r.pose_of, "what the trajectory follows; it is carried to the IMU")
      ->check(CLI::IsMember({"camera", "marker"}));
  command->add_option("--topic", r.topic, "of a bag with several event streams");
  command->add_option("--from-format", r.input_format, "of events, where content and ending do not tell");
  command->add_option("--to-format", r.output_format,
                      "of events, where the ending does not tell; euroc: a folder with frames and "
                      "IMU as EuRoC has them, with settings for ORB-SLAM3");
  command->callback([request, &run] {
    run = [request] {
      const InterruptGuard guard;
      const auto status = convert(*request);
      return status ? *status : bad_input(status.error());
    };
  });
}

}  // namespace evpose
