// SPDX-License-Identifier: BSD-3-Clause
#include <filesystem>

#include "evpose/io/motion/imu_axes.h"
#include "evpose/io/motion/trajectory.h"
#include "evpose/io/recording/dataset_layouts.h"
#include "evpose/io/recording/turn_of_events.h"
#include "info_parts.h"

namespace evpose {
namespace {

std::string under(const FoundRecording& found, const std::optional<std::string>& named, const char* usual) {
  const std::string path = found.folder + "/" + named.value_or(usual);
  std::error_code ignored;
  return std::filesystem::exists(path, ignored) ? path : "";
}

/// What was found, by name.
void list_files(Sheet& sheet, const FoundRecording& found) {
  const RecordingOverrides& f = found.files;
  const std::pair<const char*, std::string> files[] = {
      {"events", under(found, f.events, "events.h5")},
      {"imu", under(found, f.imu, "imu.csv")},
      {"imu_model", under(found, f.imu_model, "imu.yaml")},
      {"groundtruth", under(found, f.groundtruth, "groundtruth.tum")},
      {"contours", under(found, f.contours, "contours.ply")},
      {"map", under(found, f.map, "map.h5")}};
  for (const auto& [key, path] : files) {
    sheet.row(key, path.empty() ? "-" : path, path.empty() ? "" : key, path);
  }
  std::string calibration;
  for (const std::string& file : found.calibration_files)
    calibration += (calibration.empty() ? "" : ", ") + found.folder + "/" + file;
  if (calibration.empty()) calibration = under(found, f.calibration, "camchain-imucam.yaml");
  sheet.row("calibration", calibration.empty() ? "-" : calibration, calibration.empty() ? "" : "calibration",
            calibration);
}

void describe_frames(Sheet& sheet, const std::string& folder) {
  std::error_code ignored;
  std::size_t count = 0;
  for (std::filesystem::directory_iterator it(folder + "/frames", ignored), end; !ignored && it != end;
       it.increment(ignored))
    count += it->path().extension() == ".png" || it->path().extension() == ".jpg" ? 1 : 0;
  if (count == 0) return;
  sheet.section("frames: " + folder + "/frames", "frames");
  sheet.row("count", text(count), "count", count);
}

/// The parts one by one, for a folder that is no recording yet.
void describe_parts(Sheet& sheet, const FoundRecording& found) {
  const RecordingOverrides& f = found.files;
  std::optional<Span> events, imu;
  const std::string event_path = under(found, f.events, "events.h5"),
                    imu_path = under(found, f.imu, "imu.csv");
  if (!event_path.empty()) {
    const auto span = describe_events(sheet, event_path, f.events_format, f.event_options);
    if (span)
      events = *span;
    else
      sheet.find(span.error());
  }
  const bool is_text = imu_path.ends_with(".csv") || imu_path.ends_with(".txt");
  if (!imu_path.empty() && !is_text) {  // a bag, or an autopilot's log
    const auto span = describe_sensors(sheet, imu_path);
    if (span)
      imu = *span;
    else
      sheet.find(span.error());
  } else if (!imu_path.empty()) {
    const auto span = describe_imu_file(sheet, imu_path);
    if (span)
      imu = *span;
    else
      sheet.find(span.error());
  }
  if (events && imu) compare_spans(sheet, found.folder, *events, *imu);
  if (const std::string path = under(found, f.groundtruth, "groundtruth.tum"); !path.empty()) {
    const auto poses = read_trajectory(path);
    if (poses)
      describe_trajectory(sheet, path, *poses, "ground truth");
    else
      sheet.find(poses.error());
  }
  if (found.camera) {
    describe_camera(sheet, *found.camera, "camera " + found.camera->name);
  } else if (const std::string path = under(found, f.calibration, "camchain-imucam.yaml"); !path.empty()) {
    if (auto status = describe_calibration(sheet, path); !status) sheet.find(status.error());
  }
}

void describe_opened(Sheet& sheet, const FoundRecording& found, const Recording& r) {
  std::optional<Span> imu;
  std::vector<ImuSample> samples;
  const auto events = describe_events(sheet, r.events_path, r.events_format, r.event_options);
  if (!events) sheet.find(events.error());
  if (r.has_imu) {
    auto reader = open_imu(r);
    ImuSample sample;
    while (reader) {
      const auto more = reader->next(sample);
      if (!more) sheet.find(more.error());
      if (!more || !*more) break;
      samples.push_back(sample);
    }
    if (!samples.empty()) imu = describe_imu(sheet, r.imu_path, samples);
  }
  if (events && imu) compare_spans(sheet, r.folder, *events, *imu);
  if (!r.groundtruth_path.empty()) {
    const auto poses = read_groundtruth(r);
    if (poses)
      describe_trajectory(sheet, r.groundtruth_path, *poses, "ground truth");
    else
      sheet.find(poses.error());
    if (poses)
      for (const Error& doubt : doubt_axes_against(*poses, samples, r.imu_path)) sheet.find(doubt);
  } else if (r.has_imu) {
    for (const auto& doubt : {doubt_gyro_by_gravity(samples, r.imu_path),
                              doubt_camera_roll(samples, r.T_cam_body.q.toRotationMatrix(), r.imu_path)})
      if (doubt) sheet.find(*doubt);
  }
  if (events && r.has_imu)
    if (const auto doubt = doubt_gyro_by_events(r, samples); doubt && *doubt) sheet.find(**doubt);
  if (found.camera) {
    describe_camera(sheet, *found.camera, "camera " + found.camera->name);
  } else if (auto status = describe_calibration(sheet, r.calibration_path); !status) {
    sheet.find(status.error());
  }
}

}  // namespace

Status describe_recording(Sheet& sheet, const std::string& path) {
  const auto found = find_recording(path);
  if (!found) return found.error();
  sheet.section("recording: " + path, "recording");
  sheet.row("layout", found->layout, "layout", found->layout);
  sheet.row("name", found->files.name, "name", found->files.name);
  list_files(sheet, *found);
  for (const Error& missing : found->missing) sheet.find(missing);
  const auto recording = open_unjoined_recording(path);
  const bool ready = recording && !recording->clocks_apart;
  sheet.row("ready", ready ? "yes: evpose track takes it" : "no, see the findings", "ready", ready);
  if (recording) {
    if (recording->clocks_apart) sheet.find(*recording->clocks_apart);
    describe_opened(sheet, *found, *recording);
  } else {
    const auto& e = recording.error();
    const bool told = std::any_of(found->missing.begin(), found->missing.end(),
                                  [&](const Error& m) { return m.line() == e.line(); });
    if (!told) sheet.find(e);
    describe_parts(sheet, *found);
  }
  describe_frames(sheet, found->folder);
  return {};
}

}  // namespace evpose
