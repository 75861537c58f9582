// SPDX-License-Identifier: BSD-3-Clause
// A map of a cloud that is too large for one run: planned, built tile by tile, merged.
#include <algorithm>
#include <chrono>
#include <cstdio>

#include "commands.h"
#include "evpose/core/config.h"
#include "evpose/core/log.h"
#include "evpose/core/parallel.h"
#include "evpose/io/files/config_yaml.h"
#include "evpose/io/maps/cloud_files.h"
#include "evpose/io/maps/map_h5.h"
#include "evpose/io/maps/tile_files.h"
#include "evpose/map_build/map_builder.h"
#include "evpose/map_build/tiles.h"
#include "evpose/run/progress.h"
#include "interrupt.h"
#include "map_parts.h"

namespace evpose {
namespace {

const Error kInterrupted{"map build", "interrupted", "nothing was written"};

/// Where the whole cloud would be cut in one run.
std::vector<CloudTile> tiles_of(const CloudSurvey& survey, const map_build::BuildConfig& config) {
  std::vector<Eigen::Vector3f> sample;
  for (const Eigen::Vector3d& p : survey.sample.kept()) sample.push_back((p - survey.anchor).cast<float>());
  return map_build::cut_into_tiles(sample, survey.points, config.tile_points, config.tile_overlap_m);
}

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace

int plan_tiles(const BuildRequest& request) {
  map_build::BuildConfig config;
  ConfigTable table;
  describe(table, config);
  if (Status done = apply_assignments(table, request.assignments); !done) return bad_input(done.error());
  const auto survey = survey_cloud(request.input, map_build::kTileSample);
  if (!survey) return bad_input(survey.error());
  if (survey->viewpoint)
    return bad_input({request.input, "says where its scanner stood: shadows need the whole cloud at once",
                      "build it in one run, without --plan"});
  TilePlan plan{request.output, request.input, survey->anchor, tiles_of(*survey, config), {}};
  auto writer =
      TileCloudWriter::create(std::move(plan), survey->brightness_scale.has_value(), table.to_yaml());
  if (!writer) return bad_input(writer.error());
  const InterruptGuard guard;
  Progress progress("cutting");
  std::size_t done = 0;
  const Status cut = visit_cloud(*survey, [&](const PointCloud& block) {
    done += block.points.size();
    progress.at(static_cast<double>(done) / static_cast<double>(survey->points));
    return InterruptGuard::interrupted() ? Status(kInterrupted) : writer->add(block);
  });
  progress.done();
  if (InterruptGuard::interrupted()) return kInterruptedStatus;
  if (!cut) return bad_input(cut.error());
  const auto written = writer->commit();
  if (!written) return bad_input(written.error());
  std::size_t largest = 0;
  for (const std::size_t points : written->points) largest = std::max(largest, points);
  const std::string& folder = request.output;
  std::printf(
      "tiles      %zu of up to %zu points, in %s\n"
      "next       for each I from 0 to %zu, in any order and on any machine: evpose map build %s --tile I\n"
      "then       evpose map merge %s -o map.h5\n",
      written->tiles.size(), largest, folder.c_str(), written->tiles.size() - 1, folder.c_str(),
      folder.c_str());
  return 0;
}

int build_tile_of(const BuildRequest& request) {
  const auto plan = read_tile_plan(request.input);
  if (!plan) return bad_input(plan.error());
  const auto tile = static_cast<std::size_t>(request.tile);
  if (tile >= plan->tiles.size())
    return bad_input({text("--tile ", tile), text(request.input, " has tiles 0 to ", plan->tiles.size() - 1),
                      "give one of them"});
  map_build::BuildConfig config;
  ConfigTable table;
  describe(table, config);
  if (const Status done = apply_yaml(table, plan->settings()); !done) return bad_input(done.error());
  const auto start = std::chrono::steady_clock::now();
  auto cloud = read_tile_cloud(*plan, tile);
  if (!cloud) return bad_input(cloud.error());
  const InterruptGuard guard;
  ThreadPool pool(request.threads);
  Progress progress(text("tile ", tile));
  auto built = map_build::build_tile(*std::move(cloud), plan->tiles[tile], config, pool, [&](double share) {
    progress.at(share);
    return !InterruptGuard::interrupted();
  });
  progress.done();
  if (InterruptGuard::interrupted()) return kInterruptedStatus;
  if (!built) {
    // A tile of grass or water: the others may have contours all the same.
    log_warning(built.error().line() + "; the tile adds nothing to the map");
    built = map_build::BuiltMap{};
    built->map.anchor = plan->anchor;
  }
  if (const Status done = write_map_h5(plan->map_of(tile), built->map); !done) return bad_input(done.error());
  double length_m = 0;
  for (const ContourPoint& p : built->map.points) length_m += static_cast<double>(p.length);
  std::printf("tile %zu of %zu: %zu points, %zu planes, %.1f m of contours, %.1f s\n", tile,
              plan->tiles.size(), plan->points[tile], built->map.planes.size(), length_m,
              seconds_since(start));
  return 0;
}

int merge_tiles(const BuildRequest& request) {
  const auto plan = read_tile_plan(request.input);
  if (!plan) return bad_input(plan.error());
  ContourMap map;
  map.anchor = plan->anchor;
  map.source = plan->cloud;
  for (std::size_t tile = 0; tile < plan->tiles.size(); ++tile) {
    const auto part = read_map_h5(plan->map_of(tile));
    if (!part)
      return bad_input({request.input,
                        text("tile ", tile, " of ", plan->tiles.size(), ": ", part.error().what),
                        text("run `evpose map build ", request.input, " --tile ", tile, "` first")});
    if (part->anchor != plan->anchor)
      return bad_input({plan->map_of(tile), "belongs to another plan",
                        text("run `evpose map build ", request.input, " --tile ", tile, "` again")});
    map_build::append_tile(*part, map);
  }
  if (const Status done = map_build::complete_map(map); !done) return bad_input(done.error());
  std::printf("tiles      %zu, %zu planes, %zu points of contours\n", plan->tiles.size(), map.planes.size(),
              map.points.size());
  return finish_map(std::move(map), request);
}

}  // namespace evpose
