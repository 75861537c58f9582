// SPDX-License-Identifier: BSD-3-Clause
#include "run_options.h"

#include <CLI/CLI.hpp>
#include <cstdio>

#include "commands.h"

namespace evpose {

void add_input_options(CLI::App& command, TrackRequest& request, const std::string& calibration) {
  command.add_option("--map", request.map, "contours (PLY, PCD, map.h5); default: the recording's own");
  command.add_option(
      calibration, request.calibration,
      "calibration of any kind that evpose info knows; default: the one found with the recording");
  command.add_option("--imu-model", request.imu_model,
                     "the IMU's noise and axes as Kalibr writes them; default: the recording's imu.yaml");
  command.add_option("--occluders", request.occluders,
                     "PLY mesh that hides contours behind it; default: the map's own");
  command.add_option("--init", request.init,
                     "start: groundtruth, anywhere, gps:LAT,LON,ALT[,SIGMA], x,y,z,qx,qy,qz,qw[@t_s], or a "
                     "TUM file; default: ground "
                     "truth if there is one, else the recording's initial_pose");
  command
      .add_option("--init-sigma", request.init_sigma,
                  "how far off the given pose may be, m and deg per axis: it is searched there")
      ->delimiter(',')
      ->expected(2)
      ->check(CLI::Range(0.0, 180.0));
  command.add_option("--preset", request.preset,
                     "settings to begin with: paper, the method of EV-Pose in place of the defaults");
  command.add_option("--config", request.config_file, "YAML file with settings");
  command.add_option("--set", request.assignments, "one setting, key=value")->allow_extra_args(false);
}

void add_run_options(CLI::App& command, TrackRequest& request) {
  add_input_options(command, request, "--calibration");
  request.output = "run";
  command.add_option("-o,--output", request.output, "run folder")->capture_default_str();
  command.add_flag("--force", request.replace, "replace an earlier run in the run folder");
}

int dump_config(const TrackRequest& request) {
  auto config = load_config(request);
  if (!config) return bad_input(config.error());
  ConfigTable table;
  describe(table, *config);
  std::fputs(table.to_yaml().c_str(), stdout);
  return 0;
}

}  // namespace evpose
