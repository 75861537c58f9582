// SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <memory>
#include <set>

#include "commands.h"
#include "evpose/io/contour_files.h"
#include "evpose/io/map_h5.h"
#include "evpose/io/ply.h"

namespace evpose {
namespace {

int import_map(const std::string& contours, const std::string& occluders, const std::string& output) {
  auto map = read_contour_map(contours);
  if (!map) return bad_input(map.error());
  if (!occluders.empty()) {
    auto mesh = read_ply_mesh(occluders, map->anchor);
    if (!mesh) return bad_input(mesh.error());
    map->occluders = std::move(*mesh);
  }
  if (const auto ok = write_map_h5(output, *map); !ok) return bad_input(ok.error());
  return 0;
}

int print_map(const std::string& path) {
  const auto map = read_contour_map(path);
  if (!map) return bad_input(map.error());
  const MapFigures f = figures_of(*map);
  std::printf("points     %zu\ncontours   %zu\nlength     %.1f m\n", map->points.size(), f.contours,
              f.length_m);
  std::printf("bounds     x %.2f .. %.2f  y %.2f .. %.2f  z %.2f .. %.2f m\n", f.low.x(), f.high.x(),
              f.low.y(), f.high.y(), f.low.z(), f.high.z());
  std::printf("occluders  %zu triangles\nframe      %s\n", map->occluders.triangles.size(),
              map->frame.c_str());
  return 0;
}

}  // namespace

MapFigures figures_of(const ContourMap& map) {
  MapFigures out;
  Eigen::Vector3f low = map.points.front().position, high = low;
  std::set<std::int32_t> contours;
  for (const auto& p : map.points) {
    low = low.cwiseMin(p.position), high = high.cwiseMax(p.position);
    out.length_m += static_cast<double>(p.length);
    if (p.contour >= 0) contours.insert(p.contour);
  }
  out.contours = contours.size();
  out.low = map.anchor + low.cast<double>();
  out.high = map.anchor + high.cast<double>();
  return out;
}

void add_map(CLI::App& app, std::function<int()>& run) {
  auto* map = app.add_subcommand("map", "Make and look at map files");
  map->require_subcommand(1);
  add_map_build(*map, run);
  struct Options {
    std::string input, occluders, output = "map.h5";
  };
  auto o = std::make_shared<Options>();
  auto* import = map->add_subcommand("import", "Make a map file from contour points (PLY, PCD)");
  import->add_option("contours", o->input, "contours.ply, or any cloud of edge points")->required();
  import->add_option("--occluders", o->occluders, "PLY mesh that hides contours behind it");
  import->add_option("-o,--output", o->output, "map file")->capture_default_str();
  const auto run_import = [o] { return import_map(o->input, o->occluders, o->output); };
  import->callback([&run, run_import] { run = run_import;
});
auto* info = map->add_subcommand("info", "Counts, lengths and bounds of a map");
info->add_option("map", o->input, "map.h5, PLY or PCD")->required();
info->callback([o, &run] { run = [o] { return print_map(o->input); }; });
add_map_compare(*map, run);
}  // namespace evpose

}  // namespace evpose
