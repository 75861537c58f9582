// SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <memory>

#include "commands.h"
#include "evpose/batch/smooth_recording.h"
#include "interrupt.h"
#include "run_options.h"

namespace evpose {
namespace {

/// An interruption leaves nothing: half a recording has no future to smooth with.
int run_smooth(TrackRequest request) {
  const InterruptGuard guard;
  request.interrupted = InterruptGuard::interrupted;
  const auto outcome = smooth_recording(request);
  if (!outcome) return bad_input(outcome.error());
  return *outcome ? report_run(**outcome) : kInterruptedStatus;
}

}  // namespace

void add_smooth(CLI::App& app, std::function<int()>& run) {
  auto* command = app.add_subcommand(
      "smooth", "Estimate the trajectory of a recording from all its data, past and future");
  auto request = std::make_shared<TrackRequest>();
  command
      ->add_option("recording", request->recording,
                   "folder with events, IMU and calibration, a data set as downloaded, or a bag")
      ->required();
  add_run_options(*command, *request);
  command->callback([=, &run] { run = [=] { return run_smooth(*request); }; });
}

}  // namespace evpose
