// SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <thread>

#include "commands.h"
#include "evpose/io/maps/contour_files.h"
#include "evpose/io/maps/ply.h"
#include "evpose/view/pages.h"
#include "evpose/view/run_view.h"
#include "interrupt.h"

namespace evpose {
namespace {

struct ViewRequest {
  std::string run, map, occluders;
  ServerConfig server;
};

int view(const ViewRequest& request) {
  const auto rows = read_run(request.run);
  if (!rows) return bad_input(rows.error());
  ContourMap map;
  if (!request.map.empty()) {
    auto read = read_contour_map(request.map);
    if (!read) return bad_input(read.error());
    map = std::move(*read);
  }
  if (!request.occluders.empty()) {
    auto mesh = read_ply_mesh(request.occluders, map.anchor);
    if (!mesh) return bad_input(mesh.error());
    map.occluders = std::move(*mesh);
  }
  auto server = Server::start(request.server);
  if (!server) return bad_input(server.error());
  set_viewer_pages(**server, "run");
  (*server)->set_page("/scene.json", "application/json", scene_json(map.points.empty() ? nullptr : &map));
  (*server)->set_page(
      "/history.json", "application/json",
      history_json("run", std::filesystem::absolute(request.run).lexically_normal().filename().string(),
                   *rows));
  const InterruptGuard guard;
  std::fprintf(stderr, "evpose: open %s in a browser; Ctrl-C ends\n", (*server)->address().c_str());
  while (!InterruptGuard::interrupted()) std::this_thread::sleep_for(std::chrono::milliseconds(50));
  return 0;
}

}  // namespace

void add_view(CLI::App& app, std::function<int()>& run) {
  auto* command =
      app.add_subcommand("view", "Show a run in a browser: the map, the way, and everything over time");
  auto request = std::make_shared<ViewRequest>();
  command->add_option("run", request->run, "run folder")->required();
  command->add_option("--map", request->map, "contours to draw (PLY, PCD, map.h5)");
  command->add_option("--occluders", request->occluders, "PLY mesh to draw");
  command->add_option("--port", request->server.port, "of this machine; 0: any that is free")
      ->capture_default_str();
  command
      ->add_option("--address", request->server.address,
                   "to be bound to; not loopback: anybody on the network may look")
      ->capture_default_str();
  command->callback([=, &run] { run = [=] { return view(*request); }; });
}

}  // namespace evpose
