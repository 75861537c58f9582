// SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>

#include "commands.h"
#include "evpose/report/film.h"
#include "evpose/run/progress.h"
#include "interrupt.h"

namespace evpose {
namespace {

int render(FilmRequest request) {
  const InterruptGuard guard;
  Progress progress("rendering");
  request.progress = [&](double share) {
    progress.at(share);
    return !InterruptGuard::interrupted();
  };
  const auto pictures = render_film(request);
  progress.done();
  if (!pictures) return bad_input(pictures.error());
  if (InterruptGuard::interrupted()) return kInterruptedStatus;
  std::printf("%s: %zu pictures\n", request.output.c_str(), *pictures);
  return 0;
}

}  // namespace

void add_render(CLI::App& app, std::function<int()>& run) {
  auto* command = app.add_subcommand(
      "render", "Draw a run as a film: events, projected map, trajectory, health in words and numbers");
  auto request = std::make_shared<FilmRequest>();
  command->add_option("run", request->run, "run folder")->required();
  command->add_option("-o,--output", request->output, ".mp4 or .gif (needs ffmpeg), or a folder for .png")
      ->required();
  command->add_option("--fps", request->fps, "pictures a second")
      ->capture_default_str()
      ->check(CLI::Range(1.0, 1000.0));
  command->add_option("--speed", request->speed, "0.1: ten times slower than it was")
      ->capture_default_str()
      ->check(CLI::Range(1e-4, 1e4));
  command->add_option("--start", request->start_s, "leave out what is earlier in the run [s]")
      ->check(CLI::Range(0.0, 4e9));
  command->add_option("--duration", request->duration_s, "of the run, from the start [s]")
      ->check(CLI::Range(0.0, 4e9));
  command->callback([=, &run] { run = [=] { return render(*request); }; });
}

}  // namespace evpose
