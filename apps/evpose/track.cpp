// SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>

#include "commands.h"
#include "evpose/run/track_recording.h"
#include "interrupt.h"

namespace evpose {
namespace {

int dump_config(const TrackRequest& request) {
  auto config = load_config(request);
  if (!config) return bad_input(config.error());
  ConfigTable table;
  describe(table, *config);
  std::fputs(table.to_yaml().c_str(), stdout);
  return 0;
}

/// An interruption ends the run; what was tracked until then is written.
int run_track(TrackRequest request) {
  const InterruptGuard guard;
  request.interrupted = InterruptGuard::interrupted;
  const auto outcome = track_recording(request);
  if (!InterruptGuard::interrupted()) return report_run(outcome);
  if (outcome) report_run(outcome);
  return kInterruptedStatus;
}

}  // namespace

int report_run(const Expected<RunOutcome>& outcome) {
  if (!outcome) return bad_input(outcome.error());
  std::printf("%s\n%s\n", outcome->text.c_str(), outcome->report.c_str());
  return outcome->verdict.good() ? 0 : 1;
}

void add_track(CLI::App& app, std::function<int()>& run) {
  auto* command = app.add_subcommand("track", "Track the pose through a recording against a map");
  auto request = std::make_shared<TrackRequest>();
  auto dump = std::make_shared<bool>(false);
  auto* recording =
      command->add_option("recording", request->recording,
                          "folder with events, IMU and calibration, a data set as downloaded, or a bag");
  command->add_option("--map", request->map, "contours (PLY, PCD, map.h5); default: the recording's own");
  command->add_option(
      "--calibration", request->calibration,
      "calibration of any kind that evpose info knows; default: the one found with the recording");
  command->add_option("--occluders", request->occluders,
                      "PLY mesh that hides contours behind it; default: the map's own");
  command->add_option("--init", request->init,
                      "start: groundtruth, x,y,z,qx,qy,qz,qw[@t_s], or a TUM file; default: ground truth if "
                      "there is one, else the recording's initial_pose");
  command
      ->add_option("--init-sigma", request->init_sigma,
                   "how far off the given pose may be, m and deg per axis: it is searched there")
      ->delimiter(',')
      ->expected(2)
      ->check(CLI::Range(0.0, 10.0));
  request->output = "run";
  command->add_option("-o,--output", request->output, "run folder")->capture_default_str();
  command->add_flag("--force", request->replace, "replace an earlier run in the run folder");
  command->add_option("--learn-map", request->learnt_map,
                      "map.h5 to write: the map with the signs of contrast that the events have told");
  command->add_option("--preset", request->preset,
                      "settings to begin with: paper, the method of EV-Pose in place of the defaults");
  command->add_option("--config", request->config_file, "YAML file with settings");
  command->add_option("--set", request->assignments, "one setting, key=value")->allow_extra_args(false);
  auto* dump_flag = command->add_flag("--dump-config", *dump, "print all settings and stop");
  command->callback([=, &run] {
    if (!*dump && recording->count() == 0) throw CLI::RequiredError(recording->get_name());
    run = [=] { return *dump ? dump_config(*request) : run_track(*request); };
  });
  (void)dump_flag;
}

}  // namespace evpose
