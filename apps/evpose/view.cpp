// SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <thread>

#include "commands.h"
#include "evpose/core/log.h"
#include "evpose/report/run_pictures.h"
#include "evpose/view/pages.h"
#include "evpose/view/recorded_pictures.h"
#include "evpose/view/run_view.h"
#include "interrupt.h"

namespace evpose {
namespace {

struct ViewRequest {
  std::string run, map, occluders;
  ServerConfig server;
};

/// The run with the map that is named in place of its own.
Expected<RunFiles> read_request(const ViewRequest& request) {
  auto run = read_run_files(request.run);
  if (run && !request.map.empty()) {
    run->input.map = request.map;
    run->input.occluders = request.occluders;
  }
  return run;
}

/// The run's map. Its own may have gone: that is told, and the rest is shown.
Expected<ContourMap> map_to_draw(const ViewRequest& request, const RunFiles& run) {
  if (run.input.map.empty()) return ContourMap{};
  auto map = read_run_map(run);
  if (map || !request.map.empty()) return map;
  log_warning(map.error().line());
  return ContourMap{};
}

int view(const ViewRequest& request) {
  const auto rows = read_run(request.run);
  if (!rows) return bad_input(rows.error());
  auto run = read_request(request);
  if (!run) return bad_input(run.error());
  auto map = map_to_draw(request, *run);
  if (!map) return bad_input(map.error());
  auto server = Server::start(request.server);
  if (!server) return bad_input(server.error());
  set_viewer_pages(**server, "run");
  (*server)->set_page("/scene.json", "application/json", scene_json(map->points.empty() ? nullptr : &*map));
  (*server)->set_page(
      "/history.json", "application/json",
      history_json("run", std::filesystem::absolute(request.run).lexically_normal().filename().string(),
                   *rows));
  const RecordedPictures pictures(**server, *std::move(run), *std::move(map));
  const InterruptGuard guard;
  std::fprintf(stderr, "evpose: open %s in a browser; Ctrl-C ends\n", (*server)->address().c_str());
  while (!InterruptGuard::interrupted()) std::this_thread::sleep_for(std::chrono::milliseconds(50));
  return 0;
}

}  // namespace

void add_view(CLI::App& app, std::function<int()>& run) {
  auto* command = app.add_subcommand(
      "view", "Show a run in a browser: the map, the way, the events, and everything over time");
  auto request = std::make_shared<ViewRequest>();
  command->add_option("run", request->run, "run folder")->required();
  command->add_option("--map", request->map,
                      "map instead of the one that the run was made with (PLY, PCD, map.h5)");
  command->add_option("--occluders", request->occluders, "PLY mesh, with --map")->needs("--map");
  command->add_option("--port", request->server.port, "of this machine; 0: any that is free")
      ->capture_default_str();
  command
      ->add_option("--address", request->server.address,
                   "to be bound to; not loopback: anybody on the network may look")
      ->capture_default_str();
  command->callback([=, &run] { run = [=] { return view(*request); }; });
}

}  // namespace evpose
