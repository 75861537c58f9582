// SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>

#include "commands.h"
#include "evpose/calibrate/calibrate_recordings.h"
#include "interrupt.h"
#include "run_options.h"

namespace evpose {
namespace {

void print_calibration(const CalibrateOutcome& outcome, const std::string& output) {
  std::printf("%-8s %12s %10s %14s %10s\n", "", "given", "sigma", "found", "sigma");
  for (const auto& numbers : {outcome.page.numbers, outcome.page.imu_axes})
    for (const CalibrationNumber& n : numbers)
      std::printf("%-8s %12.6g %10.3g %14.8g %10.3g  %s\n", n.name.c_str(), n.given, n.given_sigma, n.found,
                  n.sigma, n.unit.c_str());
  for (const std::string& words : outcome.page.words) std::printf("note: %s\n", words.c_str());
  std::printf("%s%s%s, %s\n", output.c_str(), outcome.imu_model.empty() ? "" : ", ",
              outcome.imu_model.c_str(), outcome.report.c_str());
}

int run_calibrate(CalibrateRequest request) {
  const InterruptGuard guard;
  request.track.interrupted = InterruptGuard::interrupted;
  const auto outcome = calibrate_recordings(request);
  if (!outcome) return bad_input(outcome.error());
  if (!*outcome) return kInterruptedStatus;
  print_calibration(**outcome, request.track.output);
  return (*outcome)->converged ? 0 : 1;
}

}  // namespace

void add_calibrate(CLI::App& app, std::function<int()>& run) {
  auto* command = app.add_subcommand(
      "calibrate", "Calibrate the camera, and its IMU's pose and clock, from recordings before a known map");
  auto request = std::make_shared<CalibrateRequest>();
  command
      ->add_option(
          "recordings", request->recordings,
          "folders with events and, if there is one, IMU: flights of the same camera before the same map")
      ->required();
  add_input_options(*command, request->track, "--start,--calibration");
  request->track.output = "camchain.yaml";
  command
      ->add_option("-o,--output", request->track.output,
                   "Kalibr's camera chain; a report and the IMU's axes are written beside it")
      ->capture_default_str();
  command->add_flag("--force", request->track.replace, "replace earlier files of these names");
  command->callback([=, &run] { run = [=] { return run_calibrate(*request); }; });
}

}  // namespace evpose
