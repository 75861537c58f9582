// SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "commands.h"
#include "evpose/io/maps/contour_files.h"
#include "evpose/io/maps/map_h5.h"
#include "evpose/relocalization/place_index.h"
#include "evpose/run/resources.h"
#include "evpose/run/track_recording.h"

namespace evpose {
namespace {

struct IndexRequest {
  std::string map, output = "map.h5";
  TrackRequest settings;
};

double megabytes(const std::string& path) {
  std::error_code ignored;
  return 1e-6 * static_cast<double>(std::filesystem::file_size(path, ignored));
}

int index_map(const IndexRequest& request) {
  const auto config = load_config(request.settings);
  if (!config) return bad_input(config.error());
  auto read = read_contour_map(request.map);
  if (!read) return bad_input(read.error());
  const auto placement = read_map_placement(request.map);
  if (!placement) return bad_input(placement.error());
  const ContourMap map = in_file_order(*std::move(read));
  const VisibleSetConfig& view = config->tracker.visible;
  const Eigen::AlignedBox3d space = space_around(map);
  const double began_s = cpu_s();
  const ContourIndex contours(map);
  if (contours.occluders().empty() || !view.occlusion)
    return bad_input({request.map, "nothing hides its contours: what is seen from where needs no index",
                      "give a map with its surfaces (map import --occluders)"});
  PlaceTable table;
  const PlaceIndex index(contours, view, space, &table);
  const double took_s = cpu_s() - began_s;
  if (index.places().empty())
    return bad_input({request.map, "too few of its contours are seen from any place to make an index of",
                      "give a map of the whole place"});
  if (const auto ok = write_map_h5(request.output, map, "", *placement); !ok) return bad_input(ok.error());
  const double without_mb = megabytes(request.output);
  if (const auto ok = write_map_h5(request.output, map, "", *placement, &table); !ok)
    return bad_input(ok.error());
  const double with_mb = megabytes(request.output);
  const double again_s = cpu_s();
  const PlaceIndex again(contours, table);
  std::printf("%s: %zu places %.2f m apart; %.2f of %.2f MB; %.1f s, from the file %.2f s\n",
              request.output.c_str(), again.places().size(), again.edge_m(), with_mb - without_mb, with_mb,
              took_s, cpu_s() - again_s);
  return 0;
}

}  // namespace

void add_map_index(CLI::App& map, std::function<int()>& run) {
  auto request = std::make_shared<IndexRequest>();
  auto* command = map.add_subcommand(
      "index", "Add to a map what is seen from where: a search for the pose anywhere in it begins at once");
  command->add_option("map", request->map, "map.h5, PLY or PCD")->required();
  command->add_option("-o,--output", request->output, "map file; may be the same")->capture_default_str();
  command->add_option("--config", request->settings.config_file, "YAML file with the settings of the search");
  command->add_option("--set", request->settings.assignments, "one of them, key=value")
      ->allow_extra_args(false);
  command->callback([request, &run] { run = [request] { return index_map(*request); }; });
}

}  // namespace evpose
