// SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>

#include "commands.h"
#include "evpose/run/track_recording.h"
#include "interrupt.h"
#include "run_options.h"

namespace evpose {
namespace {

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
  add_run_options(*command, *request);
  command->add_option("--learn-map", request->learnt_map,
                      "map.h5 to write: the map with the signs of contrast that the events have told");
  command->add_flag("--dump-config", *dump, "print all settings and stop");
  command->callback([=, &run] {
    if (!*dump && recording->count() == 0) throw CLI::RequiredError(recording->get_name());
    run = [=] { return *dump ? dump_config(*request) : run_track(*request); };
  });
}

}  // namespace evpose
