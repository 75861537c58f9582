// SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <thread>

#include "commands.h"
#include "evpose/sim/demo_recording.h"
#include "progress.h"
#include "track_recording.h"

namespace evpose {
namespace {

int demo(const std::string& folder, const sim::DemoOptions& options) {
  std::printf("Making a %.0f s recording of a flight through a furnished room (about a minute) ...\n",
              options.duration_s);
  std::fflush(stdout);
  const std::string recording = folder + "/recording";
  {
    Progress progress("rendering");
    const auto made = sim::make_demo_recording(recording, options, [&](double share) { progress.at(share); });
    if (!made) return bad_input(made.error());
  }
  std::printf("Tracking it against its contours ...\n");
  std::fflush(stdout);
  TrackRequest request;
  request.recording = recording;
  request.occluders = recording + "/mesh.ply";
  request.output = folder + "/run";
  return report_run(track_recording(request));
}

}  // namespace

void add_demo(CLI::App& app, std::function<int()>& run) {
  auto* command =
      app.add_subcommand("demo", "Make a small recording, track it, report: the two-minute proof");
  struct Options {
    std::string folder = "evpose-demo";
    sim::DemoOptions sim;
  };
  auto o = std::make_shared<Options>();
  o->sim.threads = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
  command->add_option("-o,--output", o->folder, "folder for recording and run")->capture_default_str();
  command->add_option("--seconds", o->sim.duration_s, "length of the recording")
      ->capture_default_str()
      ->check(CLI::Range(0.5, 10.0));
  command->add_option("--seed", o->sim.seed, "of texture, motion and noise")->capture_default_str();
  command->callback([o, &run] { run = [o] { return demo(o->folder, o->sim); }; });
}

}  // namespace evpose
