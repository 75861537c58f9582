// SPDX-License-Identifier: BSD-3-Clause
// Shared recordings with a spoilt calibration: does the tracker find what was done to them?
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <memory>

#include "bench.h"
#include "bench_streams.h"
#include "commands.h"
#include "evpose/io/files/config_yaml.h"

namespace evpose {
namespace {

struct CalibrationRequest {
  std::string folder = "../shared/data/peer";
  std::vector<std::string> only, assignments;
};

struct Spoilt {
  double offset_s;
  Eigen::Vector3d turn_deg;  ///< of the given camera about the body's axes
  Eigen::Vector3d shift_mm = Eigen::Vector3d::Zero();
};

const Spoilt kSpoilt[] = {
    {0, {0, 0, 0}}, {0.02, {0, 0, 0}}, {-0.02, {0, 0, 0}},       {0, {1, 0, 0}},
    {0, {0, 1, 0}}, {0, {0, 0, 1}},    {0.01, {0.5, -0.5, 0.5}}, {0, {0, 0, 0}, {10, -10, 5}}};

Status run_one(const PeerRecording& peer, Streams streams, const Spoilt& spoilt) {
  const bool turned = spoilt.turn_deg.norm() > 0;
  CalibrationConfig& calibration = streams.job.config.tracker.fusion.calibration;
  const bool shifted = spoilt.shift_mm.norm() > 0;
  calibration.time_offset = spoilt.offset_s != 0 || !(turned || shifted);
  calibration.translation = shifted;
  calibration.rotation = turned;
  for (ImuSample& s : streams.imu) s.t += from_seconds(spoilt.offset_s);
  // The given rotation is turned back, so that the true one is turn * given.
  const Eigen::Vector3d turn = spoilt.turn_deg * (M_PI / 180);
  Eigen::Quaterniond& given = streams.job.setup.T_body_cam.q;
  const Pose T_map_cam = streams.job.start.T_map_body * streams.job.setup.T_body_cam;
  given = so3::exp(-turn) * given;
  if (turned) {
    // The start is where the camera was seen to be; the body's attitude is as wrong as the calibration.
    streams.job.start.T_map_body = T_map_cam * streams.job.setup.T_body_cam.inverse();
    streams.job.config.tracker.fusion.start_rotation_sigma_rad = calibration.start_rotation_sigma_rad;
  }
  if (shifted) {
    streams.job.setup.T_body_cam.p -= 1e-3 * spoilt.shift_mm;
    streams.job.start.T_map_body = T_map_cam * streams.job.setup.T_body_cam.inverse();
    streams.job.config.tracker.fusion.start_position_sigma_m = 0.01;
  }
  auto tracker = Tracker::create(streams.job.setup, streams.job.config.tracker, streams.job.start);
  if (!tracker) return tracker.error();
  Health at_end = Health::waiting;
  int frozen = 0, updates = 0;
  (*tracker)->on_update([&](const Update& u) {
    at_end = u.health;
    ++updates;
    frozen += (*tracker)->calibration().frozen ? 1 : 0;
  });
  feed(streams.packets, streams.imu, **tracker);
  const Calibration found = (*tracker)->calibration();
  const double degrees = 180 / M_PI;
  std::printf("| %s | %.0f | %.1f, %.1f, %.1f | %.0f, %.0f, %.0f | %s | ", peer.name.c_str(),
              1e3 * spoilt.offset_s, spoilt.turn_deg.x(), spoilt.turn_deg.y(), spoilt.turn_deg.z(),
              spoilt.shift_mm.x(), spoilt.shift_mm.y(), spoilt.shift_mm.z(), to_string(at_end));
  if (calibration.time_offset)
    std::printf("%.3f +- %.3f | ", 1e3 * (found.time_offset_s - spoilt.offset_s), 1e3 * found.time_sigma_s);
  else
    std::printf("- | ");
  if (calibration.rotation)
    std::printf("%.3f +- %.3f | ", degrees * so3::log(found.turn * so3::exp(turn).conjugate()).norm(),
                degrees * found.turn_sigma_rad.norm());
  else
    std::printf("- | ");
  if (calibration.translation)
    std::printf("%.1f +- %.1f | ", (1e3 * found.shift - spoilt.shift_mm).norm(),
                1e3 * found.shift_sigma_m.norm());
  else
    std::printf("- | ");
  std::printf("%.0f |\n", 100.0 * frozen / std::max(1, updates));
  std::fflush(stdout);
  return {};
}

int bench_calibration(const CalibrationRequest& request) {
  RunConfig config;
  ConfigTable table;
  describe(table, config);
  for (const auto& assignment : request.assignments)
    if (auto ok = apply_assignment(table, assignment); !ok) return bad_input(ok.error());
  std::printf(
      "Made by `evpose bench calibration`; do not edit.\n\n| recording | offset given wrong by ms | rotation "
      "given wrong "
      "by deg | shifted by mm | at the end | offset error ms | rotation error deg | shift error mm | frozen "
      "%% of "
      "the time |\n|---|---|---|---|---|---|---|---|---|\n");
  for (const PeerRecording& peer : peer_recordings(request.folder)) {
    if (request.only.empty()
            ? peer.name == "room_720p"  // one second long
            : std::find(request.only.begin(), request.only.end(), peer.name) == request.only.end())
      continue;
    TrackRequest track;
    track.recording = peer.folder;
    track.map = peer.map;
    track.occluders = peer.occluders;
    const auto streams = load_streams(track, config);
    if (!streams) return bad_input(streams.error());
    for (const Spoilt& spoilt : kSpoilt)
      if (auto ok = run_one(peer, *streams, spoilt); !ok) return bad_input(ok.error());
  }
  return 0;
}

}  // namespace

void add_bench_calibration(CLI::App& bench, std::function<int()>& run) {
  auto* command =
      bench.add_subcommand("calibration", "Time offset and camera rotation found from a wrong start");
  auto request = std::make_shared<CalibrationRequest>();
  command->add_option("folder", request->folder, "folder with the recordings and maps")
      ->capture_default_str();
  command->add_option("--only", request->only, "names of recordings")->delimiter(',');
  command->add_option("--set", request->assignments, "one setting, key=value")->allow_extra_args(false);
  command->callback([=, &run] { run = [=] { return bench_calibration(*request); }; });
}

}  // namespace evpose
