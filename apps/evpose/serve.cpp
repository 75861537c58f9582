// SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>

#include "commands.h"
#include "serve_live.h"
#include "serve_ros.h"

namespace evpose {
namespace {

int dump_config(const ServeRequest& request) {
  auto config = load_serve_config(request.track);
  if (!config) return bad_input(config.error());
  ConfigTable table;
  describe(table, *config);
  std::fputs(table.to_yaml().c_str(), stdout);
  return 0;
}

int run_serve(const ServeRequest& request, bool ros) {
  const std::string& source = request.track.recording;
  if (is_ros_address(source)) return bad_input(start_ros_node(request));
  if (ros)
    return bad_input({"--ros", "the ROS node takes its input from topics",
                      "name the source ros; a recording gets there by `evpose convert " + source +
                          " RECORDING.bag` and `rosbag play`"});
  const auto status = serve(request);
  return status ? *status : bad_input(status.error());
}

}  // namespace

void add_serve(CLI::App& app, std::function<int()>& run) {
  auto* command = app.add_subcommand(
      "serve",
      "Track a live stream, or a recording as if it were one, and hand the pose on (docs/use/live.md)");
  auto request = std::make_shared<ServeRequest>();
  auto dump = std::make_shared<bool>(false);
  auto speed = std::make_shared<double>(1);
  TrackRequest& track = request->track;
  auto* source =
      command->add_option("source", track.recording,
                          "a recording; or udp://HOST:PORT, tcp://HOST:PORT, where a camera's driver "
                          "sends packets; or metavision://SERIAL[+udp://HOST:PORT of the IMU]; or ros, "
                          "ros://EVENTS,IMU: topics of ROS");
  command->add_option("--map", track.map, "contours (PLY, PCD, map.h5); default: the recording's own");
  command->add_option("--calibration", track.calibration, "calibration of any kind that evpose info knows");
  command->add_option("--imu-model", track.imu_model,
                      "the IMU's noise and axes as Kalibr writes them; default: the recording's imu.yaml");
  command->add_option("--occluders", track.occluders, "PLY mesh that hides contours behind it");
  command->add_option(
      "--init", track.init,
      "start: groundtruth, anywhere, gps:LAT,LON,ALT[,SIGMA], x,y,z,qx,qy,qz,qw[@t_s], or a TUM file");
  command
      ->add_option("--init-sigma", track.init_sigma,
                   "how far off the given pose may be, m and deg per axis: it is searched there")
      ->delimiter(',')
      ->expected(2)
      ->check(CLI::Range(0.0, 180.0));
  command->add_option("--mavlink", request->mavlink,
                      "to an autopilot: udp://HOST:PORT, udpin://HOST:PORT or serial:///dev/ttyX:BAUD");
  auto port = std::make_shared<int>(8088);
  auto* view_option =
      command->add_option("--view", *port, "show it in a browser, at this port of this machine")
          ->expected(0, 1)
          ->check(CLI::Range(0, 65535))
          ->default_str("8088");
  auto ros = std::make_shared<bool>(false);
  command->add_flag("--ros", *ros, "of the source ros: publish by ROS (it always does)");
  auto* speed_option = command->add_option(
      "--speed", *speed, "of a recording against the wall clock; 0: as fast as it is tracked, nothing shed");
  command->add_option("-o,--output", track.output, "run folder; default: none is written");
  command->add_flag("--force", track.replace, "replace an earlier run in the run folder");
  command->add_option("--config", track.config_file, "YAML file with settings");
  command->add_option("--set", track.assignments, "one setting, key=value")->allow_extra_args(false);
  command->add_flag("--dump-config", *dump, "print all settings and stop");
  command->callback([=, &run] {
    if (!*dump && source->count() == 0) throw CLI::RequiredError(source->get_name());
    if (view_option->count() > 0) request->view = *port;
    if (speed_option->count() > 0) {
      request->track.assignments.push_back("replay.speed=" + std::to_string(*speed));
      if (*speed == 0) request->track.assignments.emplace_back("queue.shed=false");
    }
    run = [=] { return *dump ? dump_config(*request) : run_serve(*request, *ros); };
  });
}

}  // namespace evpose
