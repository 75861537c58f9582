// SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <thread>

#include "commands.h"
#include "evpose/run/progress.h"
#include "evpose/run/track_recording.h"
#include "evpose/sim/recording/recording_maker.h"

namespace evpose {
namespace {

// A small camera, so that it is done in two minutes.
sim::Scenario demo_scenario(double duration_s, int seed) {
  sim::Scenario scenario;
  scenario.name = "demo";
  scenario.description = "square spiral in a hall, small camera";
  scenario.duration_s = duration_s;
  scenario.seed = scenario.trajectory.seed = seed;
  scenario.camera.size = sim::SensorSize::custom;
  scenario.camera.width = 480;
  scenario.camera.height = 360;
  scenario.camera.focal_px = 286;
  scenario.trajectory.speed_m_s = 0.7;
  return scenario;
}

int demo(const std::string& folder, const sim::Scenario& scenario, int threads) {
  std::printf("Making a %.0f s recording of a flight through a furnished hall (about a minute) ...\n",
              scenario.duration_s);
  std::fflush(stdout);
  const std::string recording = folder + "/recording";
  {
    Progress progress("rendering");
    const auto made =
        sim::make_recording(scenario, recording, threads, [&](double share) { progress.at(share); });
    if (!made) return bad_input(made.error());
  }
  std::printf("Tracking it against its contours ...\n");
  std::fflush(stdout);
  TrackRequest request;
  request.recording = recording;
  request.occluders = recording + "/mesh.ply";
  request.output = folder + "/run";
  request.replace = true;  // as the recording
  return report_run(track_recording(request));
}

}  // namespace

void add_demo(CLI::App& app, std::function<int()>& run) {
  auto* command =
      app.add_subcommand("demo", "Make a small recording, track it, report: the two-minute proof");
  struct Options {
    std::string folder = "evpose-demo";
    double duration_s = 3;
    int seed = 1;
    int threads = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
  };
  auto o = std::make_shared<Options>();
  command->add_option("-o,--output", o->folder, "folder for recording and run")->capture_default_str();
  command->add_option("--seconds", o->duration_s, "length of the recording")
      ->capture_default_str()
      ->check(CLI::Range(0.5, 10.0));
  command->add_option("--seed", o->seed, "of motion and noise")->capture_default_str();
  command->callback([o, &run] {
    run = [o] { return demo(o->folder, demo_scenario(o->duration_s, o->seed), o->threads); };
  });
}

}  // namespace evpose
