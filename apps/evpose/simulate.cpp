// SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <thread>

#include "commands.h"
#include "evpose/core/config.h"
#include "evpose/core/log.h"
#include "evpose/io/files/config_yaml.h"
#include "evpose/run/progress.h"
#include "evpose/sim/recording/recording_maker.h"

namespace evpose {
namespace {

struct SimulateRequest {
  std::string scenario, output, world_cache;
  std::vector<std::string> assignments;
  double duration_s = 0;
  int seed = -1;
  int threads = 1;
  bool dump = false;
};

namespace fs = std::filesystem;

// A file, or the name of a scenario that comes with the program: in the source tree, or where it is
// installed.
Expected<std::string> find_scenario(const std::string& name) {
  std::error_code ignored;
  if (fs::is_regular_file(name, ignored)) return name;
  const fs::path program = fs::read_symlink("/proc/self/exe", ignored);
  const fs::path installed = (program.parent_path() / EVPOSE_SCENARIOS).lexically_normal();
  for (const fs::path& folder : {fs::path("scenarios"), installed}) {
    const fs::path path = folder / (name + ".yaml");
    if (name.find('/') == std::string::npos && fs::is_regular_file(path, ignored)) return path.string();
  }
  const std::string known = fs::is_directory(installed, ignored) ? installed.string() : "scenarios";
  return Error{name, "no such scenario", text("give a file, or the name of one in the folder ", known)};
}

Expected<sim::Scenario> load_scenario(const SimulateRequest& request) {
  sim::Scenario scenario;
  ConfigTable table;
  describe(table, scenario);
  if (!request.scenario.empty()) {
    const auto path = find_scenario(request.scenario);
    if (!path) return path.error();
    if (Status done = apply_yaml(table, *path); !done) return done.error();
    // Files that it names are beside it.
    const fs::path beside = fs::path(*path).parent_path();
    for (std::string* file : {&scenario.scene_file, &scenario.trajectory.file}) {
      if (!file->empty()) *file = (beside / *file).string();
    }
  }
  if (Status done = apply_assignments(table, request.assignments); !done) return done.error();
  if (request.duration_s > 0) scenario.duration_s = request.duration_s;
  if (request.seed >= 0) scenario.seed = scenario.world.seed = scenario.trajectory.seed = request.seed;
  return scenario;
}

double mega(std::int64_t n) { return static_cast<double>(n) * 1e-6; }

int simulate(const SimulateRequest& request) {
  auto scenario = load_scenario(request);
  if (!scenario) return bad_input(scenario.error());
  if (request.dump) {
    ConfigTable table;
    describe(table, *scenario);
    std::fputs(table.to_yaml().c_str(), stdout);
    return 0;
  }
  const auto start = std::chrono::steady_clock::now();
  Progress progress("simulating");
  const auto made = sim::make_recording(
      *scenario, request.output, request.threads, [&](double share) { progress.at(share); },
      request.world_cache);
  progress.done();
  if (!made) return bad_input(made.error());
  const double wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  const auto& cause = made->by_cause;
  const auto& origin = made->by_origin;
  const double signal = std::max(1.0, static_cast<double>(cause[0]));
  std::printf(
      "%s: %.2f s, %.3f million events (%.2f Mev/s), %lld late, %lld lost in read-out, %lld filtered, %lld "
      "shed\n"
      "  signal %.1f %% (texture %.1f, edges %.1f, moving things %.1f %% of it), leak %.1f %%, shot noise "
      "%.1f %%, "
      "hot pixels %.1f %%\n"
      "  %zu contour points, %d pictures; %.1f s of work, %.1f s per simulated second, %d threads\n",
      request.output.c_str(), made->duration_s, mega(made->read_out.delivered),
      mega(made->read_out.delivered) / made->duration_s, static_cast<long long>(made->read_out.late),
      static_cast<long long>(made->read_out.lost), static_cast<long long>(made->read_out.trailing),
      static_cast<long long>(made->read_out.shed),
      100 * signal / std::max(1.0, static_cast<double>(made->read_out.delivered)),
      100 * static_cast<double>(origin[0]) / signal, 100 * static_cast<double>(origin[1]) / signal,
      100 * static_cast<double>(origin[2]) / signal,
      100 * static_cast<double>(cause[1]) / std::max(1.0, static_cast<double>(made->read_out.delivered)),
      100 * static_cast<double>(cause[2]) / std::max(1.0, static_cast<double>(made->read_out.delivered)),
      100 * static_cast<double>(cause[3]) / std::max(1.0, static_cast<double>(made->read_out.delivered)),
      made->contour_points, made->frames, wall_s, wall_s / made->duration_s, request.threads);
  const sim::PixelIntegratorCounts& work = made->integrator;
  log_detail(text("integrator: ", work.blocks, " blocks, ", work.samples, " samples of pixels, ",
                  100.0 * static_cast<double>(work.border_samples) / static_cast<double>(work.samples),
                  " % of them with a border, ", work.knots, " knots between samples"));
  return 0;
}

}  // namespace

void add_simulate(CLI::App& app, std::function<int()>& run) {
  auto* command = app.add_subcommand("simulate", "Make the recording of a flight through a made-up world");
  auto request = std::make_shared<SimulateRequest>();
  request->threads = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
  command->add_option(
      "scenario", request->scenario,
      "YAML file, or the name of one that comes with evpose; default: a spiral through a hall");
  auto* output = command->add_option("-o,--output", request->output, "recording folder");
  command->add_option("--duration", request->duration_s, "seconds, instead of the scenario's");
  command->add_option("--seed", request->seed, "of world, trajectory and noise, instead of the scenario's");
  command->add_option("--set", request->assignments, "one setting, key=value")->allow_extra_args(false);
  command->add_option("--threads", request->threads, "that work; the recording is the same for any number")
      ->capture_default_str()
      ->check(CLI::Range(1, 256));
  command->add_option(
      "--world-cache", request->world_cache,
      "folder in which light and contours of worlds are kept: the next flight through one begins "
      "at once");
  command->add_flag("--dump-config", request->dump, "print all settings and stop");
  command->callback([=, &run] {
    if (!request->dump && output->count() == 0) throw CLI::RequiredError(output->get_name());
    run = [=] { return simulate(*request); };
  });
}

}  // namespace evpose
