// SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>

#include "check_parts.h"
#include "commands.h"
#include "evpose/camera/placement.h"
#include "evpose/core/log.h"
#include "evpose/io/formats/event_formats.h"
#include "evpose/io/motion/imu_axes.h"
#include "evpose/io/recording/clock_offset.h"
#include "evpose/io/recording/dataset_layouts.h"
#include "evpose/io/recording/event_survey.h"
#include "evpose/io/recording/imu_survey.h"
#include "evpose/io/recording/trail_survey.h"
#include "evpose/io/recording/turn_of_events.h"
#include "evpose/run/progress.h"
#include "info_parts.h"
#include "sheet.h"

namespace evpose {
namespace {

constexpr double kSlowImu_hz = 90;       // flights with IMUs of 100 Hz are tracked, of 50 Hz hardly
constexpr double kMostOutside = 0.2;     // share of the events that may lie outside of the IMU's time
constexpr double kWorthTelling_s = 0.1;  // of events outside
constexpr std::int64_t kFewestEvents = 1000;
constexpr double kOneSign = 0.02;        // share of the rarer polarity
constexpr double kLongestLever_m = 0.5;  // between IMU and camera of one rig
constexpr double kLongestTimeshift_s = 0.1;
// Translation makes events, too: only much better agreement, and an offset beyond that, says that clocks are
// wrong.
constexpr double kClockError_s = 0.05;
constexpr double kClockLead = 0.2;

std::string name_of(const std::string& path) { return path.substr(path.rfind('/') + 1); }

/// Names of the files that a recording is made of.
void check_files(Checklist& list, const Recording& r) {
  std::string names;
  for (const std::string& path : {r.events_path, r.imu_path, r.calibration_path, r.imu_model_path,
                                  r.groundtruth_path, r.map_path, r.contours_path})
    if (!path.empty() && names.find(name_of(path)) == std::string::npos)
      names += (names.empty() ? "" : ", ") + name_of(path);
  list.ok("files", r.layout + ": " + names);
  for (const Error& missing : r.missing) list.note("files", missing.line());
}

/// A file of a recording that could not be opened; empty: there is none.
std::string beside(const FoundRecording& found, const std::optional<std::string>& named, const char* usual) {
  const std::string path = found.folder + "/" + named.value_or(usual);
  std::error_code ignored;
  return std::filesystem::exists(path, ignored) ? path : "";
}

Expected<std::vector<ImuSample>> read_imu(const Recording& r) {
  auto reader = open_imu(r);
  if (!reader) return reader.error();
  std::vector<ImuSample> out;
  ImuSample sample;
  while (true) {
    const auto more = reader->next(sample);
    if (!more) return more.error();
    if (!*more) return out;
    out.push_back(sample);
  }
}

struct SurveyedEvents {
  EventSummary summary;
  std::optional<double> filtered_gap_s;  ///< TrailSurvey's
};

Expected<SurveyedEvents> survey_events(const Recording& r) {
  auto reader = open_events(r);
  if (!reader) return reader.error();
  EventSurvey survey;
  TrailSurvey trails(r.camera.size);
  EventPacket packet;
  Progress progress("reading events");
  while (true) {
    const auto more = (*reader)->next(packet);
    if (!more) return more.error();
    if (!*more) break;
    survey.add(packet);
    trails.add(packet);
    progress.at(to_seconds(packet.time(packet.events.back()) - r.first_ns) /
                std::max(1e-9, to_seconds(r.last_ns - r.first_ns)));
  }
  progress.done();
  return SurveyedEvents{survey.finish(), trails.filtered_gap_s()};
}

/// How an IMU of that kind of file is made faster.
std::string faster_imu(const std::string& path) {
  const auto format = find_event_format(path, "");
  if (format && std::string((*format)->name) == "dataflash")
    return "set LOG_BITMASK bit 18 (add 262144: fast IMU) on the autopilot, and fly again: 400 Hz instead of "
           "25";
  return "raise the rate of the IMU's driver to 200 Hz or more, and record again";
}

void check_events(Checklist& list, const Recording& r, const EventSummary& events) {
  const double share_on =
      events.count == 0 ? 0 : static_cast<double>(events.on) / static_cast<double>(events.count);
  if (events.count < kFewestEvents)
    list.problem("events",
                 {r.events_path, text("only ", events.count, " events"), "record motion, in light"});
  else if (std::min(share_on, 1 - share_on) < kOneSign)
    list.problem("events", {r.events_path, text(std::round(100 * share_on), " % of the events are on events"),
                            "check the biases of the sensor, and the column of the polarity"});
  else
    list.ok("events",
            text(fixed(1e-6 * static_cast<double>(events.count), 2), " million in ",
                 fixed(events.duration_s(), 2), " s, ", fixed(1e-6 * events.mean_rate(), 2), " Mev/s"));
  if (events.hot_count > 0)
    list.note("events", text(events.hot_count, " hot pixels: the tracker masks them"));
}

/// What joins two clocks, said in the recording.
std::string joining_words(const Recording& r, const ClockOffset& found) {
  const double set_s = to_seconds(r.event_options.offset_ns) - r.timeshift_cam_imu_s + found.offset_s;
  return text("set time: {offset_events_s: ", fixed(set_s, 3),
              "} in recording.yaml: then events come when the IMU turns (correlation ",
              fixed(found.correlation, 2),
              "); good to 10 ms: state timeshift_sigma: 0.01 in the calibration");
}

/// A filter on the sensor moves events by up to half a pixel: the tracker has to know of it.
void check_trail_filter(Checklist& list, const Recording& r, const std::optional<double>& gap_s) {
  const bool stated = r.trail_filter.kind != TrailFilterKind::none;
  if (!gap_s || stated) return;
  list.problem("trail filter", {r.events_path,
                                text("no pixel gives two successive events of one polarity within ",
                                     1e3 * *gap_s, " ms: a trail filter was on, and poses will be off"),
                                text("state trail_filter (first or second) and trail_filter_gap, at least ",
                                     *gap_s, " s, in the calibration; or turn it off and record again")});
}

/// Streams on one clock, as far as is known: the events without IMU.
void check_common_time(Checklist& list, const CheckedRecording& data, const EventSummary& events,
                       const std::optional<ClockOffset>& offset) {
  const Recording& r = data.recording;
  const double outside_s = events.duration_s() - to_seconds(std::min(events.last, data.imu.back().t) -
                                                            std::max(events.first, data.imu.front().t));
  const std::string words =
      text(fixed(outside_s, 2), " s of ", fixed(events.duration_s(), 2), " s of events have no IMU");
  if (outside_s > kMostOutside * events.duration_s() && outside_s > kWorthTelling_s)
    list.problem("clocks", {r.imu_path, words,
                            "set time.offset_events_s in recording.yaml, or record both throughout"});
  else if (outside_s > kWorthTelling_s)
    list.note("clocks", words + ": they are left out");
  else
    list.ok("clocks", text("events and IMU overlap, ", span_text({r.first_ns, r.last_ns}),
                           offset ? "; events come when the IMU turns" : ""));
}

/// Everything that can be said without a map.
void check_recording(Checklist& list, const CheckedRecording& data) {
  check_clocks(list, data);
  check_imu(list, data);
  check_calibration(list, data);
}

int check(const TrackRequest& request) {
  const auto found = find_recording(request.recording);
  if (!found) return bad_input(found.error());
  Checklist list;
  CheckedRecording data;
  const auto recording = open_unjoined_recording(request.recording, request.calibration);
  if (recording) {
    data.recording = *recording;
    if (auto camera = make_camera(recording->camera)) data.camera = *camera;
    check_files(list, data.recording);
    if (data.recording.has_imu)
      if (auto read = read_imu(data.recording); read) data.imu = *std::move(read);
    if (!data.recording.groundtruth_path.empty()) {
      auto read = read_groundtruth(data.recording);
      if (!read)
        list.problem("ground truth", read.error());
      else
        data.truth = *std::move(read);
    }
    check_recording(list, data);
  } else {
    data.recording.folder = found->folder;
    data.recording.map_path = beside(*found, found->files.map, "map.h5");
    data.recording.contours_path = beside(*found, found->files.contours, "contours.ply");
    list.problem("recording", recording.error());
    for (const char* thing : {"clocks", "IMU", "calibration"}) list.skipped(thing);
  }
  const auto map = check_map(list, request, data.recording);
  if (recording && map && !data.recording.clocks_apart)
    check_start(list, request, data, *map);
  else
    list.skipped("start");
  const int problems = list.problems();
  std::printf("%s\n", problems == 0   ? "nothing stands between this recording and a pose"
                      : problems == 1 ? "1 problem"
                                      : text(problems, " problems").c_str());
  return problems == 0 ? 0 : 1;
}

}  // namespace

void check_clocks(Checklist& list, const CheckedRecording& data) {
  const auto events = survey_events(data.recording);
  if (!events) return list.problem("events", events.error());
  const EventSummary& summary = events->summary;
  check_events(list, data.recording, summary);
  check_trail_filter(list, data.recording, events->filtered_gap_s);
  if (data.imu.empty()) return;
  const auto offset = find_clock_offset(summary, data.imu);
  if (data.recording.clocks_apart) {
    Error apart = *data.recording.clocks_apart;
    if (offset) apart.fix = joining_words(data.recording, *offset);
    return list.problem("clocks", apart);
  }
  const bool wrong = offset && std::abs(offset->offset_s) > kClockError_s &&
                     offset->correlation > offset->as_read + kClockLead;
  if (wrong)
    list.problem("clocks", {data.recording.imu_path,
                            text("the events do not come when the IMU turns (correlation ",
                                 fixed(offset->as_read, 2), "), but would on another clock"),
                            joining_words(data.recording, *offset)});
  else
    check_common_time(list, data, summary, offset);
}

void check_imu(Checklist& list, const CheckedRecording& data) {
  const Recording& r = data.recording;
  if (!r.has_imu) return list.note("IMU", "there is none: tracked by constant velocity, smooth motion only");
  const ImuSummary s = survey_imu(data.imu);
  const std::string rate = fixed(s.rate_hz(), 0) + " Hz";
  if (s.rate_hz() < kSlowImu_hz)
    list.problem("IMU rate", {r.imu_path, rate + " is too slow", faster_imu(r.imu_path)});
  else
    list.ok("IMU rate", rate + (s.gap_count > 0 ? text(", ", s.gap_count, " gaps") : ""));
  std::vector<Error> doubts = doubt_axes_against(data.truth, data.imu, r.imu_path);
  if (auto doubt = doubt_imu_scales(data.imu, r.imu_path)) doubts.push_back(*doubt);
  if (auto doubt = doubt_gyro_by_gravity(data.imu, r.imu_path); doubt && doubts.empty())
    doubts.push_back(*doubt);
  if (const auto doubt = doubt_gyro_by_events(r, data.imu); doubt && *doubt && doubts.empty())
    doubts.push_back(**doubt);
  for (const Error& doubt : doubts) list.problem("IMU", doubt);
  if (doubts.empty())
    list.ok("IMU", text("mean |a| ", fixed(s.mean_accel_norm, 2), " m/s^2; ",
                        data.truth.empty() ? "gravity" : "the ground truth",
                        " and the turn of the events do not contradict its axes"));
}

void check_calibration(Checklist& list, const CheckedRecording& data) {
  const Recording& r = data.recording;
  const CameraIntrinsics& c = r.camera;
  const Pose T_body_cam = r.T_cam_body.inverse();
  const double shift_s = to_seconds(r.event_options.offset_ns);
  const int before = list.problems();
  const auto wrong = [&](const std::string& what, const std::string& fix) {
    list.problem("calibration", {r.calibration_path, what, fix});
  };
  if (const auto camera = make_camera(c); !camera) wrong(camera.error().what, camera.error().fix);
  if (!c.size.contains(Eigen::Vector2d(c.cx, c.cy)))
    wrong(text("the centre (", c.cx, ", ", c.cy, ") lies outside of the image"),
          "is it of another resolution?");
  if (c.fx < 0.2 * c.size.width || c.fx > 20 * c.size.width)
    wrong(text("a focal length of ", c.fx, " px does not go with an image ", c.size.width, " px wide"),
          "give it in pixels, of this resolution");
  if (T_body_cam.p.norm() > kLongestLever_m)
    wrong(text("the camera sits ", fixed(T_body_cam.p.norm(), 2), " m off the IMU: millimetres?"),
          "give T_cam_imu in metres");
  // Larger ones than a calibration leaves join two clocks: those are meant.
  if (std::abs(shift_s) > kLongestTimeshift_s && std::abs(shift_s) < 1)
    wrong(text("camera and IMU are ", fixed(1e3 * shift_s, 1), " ms apart"),
          "is timeshift_cam_imu in seconds?");
  if (list.problems() == before)
    list.ok("calibration", text(c.size.width, " x ", c.size.height, ", f ", fixed(c.fx, 0), " px; camera ",
                                placement_in_words(T_body_cam)));
}

void add_check(CLI::App& app, std::function<int()>& run) {
  auto* command =
      app.add_subcommand("check", "Everything that stands between a recording and a pose, in order");
  auto request = std::make_shared<TrackRequest>();
  command->add_option("recording", request->recording, "as of evpose track")->required();
  command->add_option("--map", request->map, "contours (PLY, PCD, map.h5); default: the recording's own");
  command->add_option(
      "--calibration", request->calibration,
      "calibration of any kind that evpose info knows; default: the one found with the recording");
  command->add_option("--init", request->init, "start, as of evpose track");
  command->footer("Exit status: 0 nothing is wrong; 1 something is; 2 there is no such recording.");
  command->callback([=, &run] { run = [=] { return check(*request); }; });
}

}  // namespace evpose
