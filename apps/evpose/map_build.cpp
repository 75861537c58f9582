// SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <memory>
#include <span>
#include <thread>

#include "commands.h"
#include "evpose/core/config.h"
#include "evpose/core/log.h"
#include "evpose/core/parallel.h"
#include "evpose/eval/map_score.h"
#include "evpose/io/files/config_yaml.h"
#include "evpose/io/maps/cloud_files.h"
#include "evpose/io/maps/contour_files.h"
#include "evpose/io/maps/map_h5.h"
#include "evpose/io/motion/trajectory_tum.h"
#include "evpose/map_build/gravity.h"
#include "evpose/map_build/map_builder.h"
#include "evpose/map_build/paper_map.h"
#include "evpose/report/map_accuracy.h"
#include "evpose/run/progress.h"
#include "interrupt.h"
#include "map_parts.h"

namespace evpose {
namespace {

constexpr int kSurveyCells = 10;           // along the longer side: a second of work
constexpr double kSurveyPitch_rad = 0.52;  // 30 deg down
constexpr double kLeastGoodShare = 0.5;    // of a map's cells, good to 15 mm: fewer are worth a warning

/// Where in the map a pose can be told, and what was written.
void print_verdict(const ContourMap& map, const std::string& output) {
  if (map.points.empty()) {
    log_warning(output + ": the cloud has no contours that were found: nothing can be tracked with this map");
    return;
  }
  const auto heights_m = survey_heights(map);
  const AccuracyShares shares =
      shares_of(survey_accuracy(map, survey_camera(), kSurveyPitch_rad, heights_m, kSurveyCells));
  std::printf(
      "verdict    a pose is told to 5 mm in %.0f %% of the volume, to 15 mm in %.0f %%, to 50 mm in %.0f "
      "%%\n",
      100 * shares.to_5mm, 100 * shares.to_15mm, 100 * shares.to_50mm);
  std::printf("output     %s; `evpose map info %s --report map.html` draws it\n", output.c_str(),
              output.c_str());
  std::fflush(stdout);
  if (shares.to_15mm < kLeastGoodShare)
    log_warning(
        text(output, ": a pose is told to 15 mm in ", std::round(100 * shares.to_15mm),
             " % of the volume only; scan more densely or with less noise, or fly near the contours that "
             "the report shows"));
}

void print_up(const map_build::UpDirection& up, bool level) {
  if (!up.known)
    std::printf("up         unknown: neither a floor nor walls of two directions%s\n",
                level ? "; not levelled" : "");
  else
    std::printf("up         %.4f %.4f %.4f, %.2f deg from z%s\n", up.up.x(), up.up.y(), up.up.z(),
                up.tilt_rad * 57.29577951,
                level                  ? "; levelled"
                : up.tilt_rad > 0.0009 ? "; --level turns the map"
                                       : "");
}

int build(const BuildRequest& request) {
  map_build::BuildConfig config;
  ConfigTable table;
  describe(table, config);
  if (Status done = apply_assignments(table, request.assignments); !done) return bad_input(done.error());
  if (request.viewpoints.size() % 3 != 0)
    return bad_input({"--viewpoint", text("has ", request.viewpoints.size(), " numbers in all"),
                      "give X,Y,Z in metres for each"});
  const auto start = std::chrono::steady_clock::now();
  auto cloud = read_cloud(request.input);
  if (!cloud) return bad_input(cloud.error());
  for (std::size_t k = 0; k < request.viewpoints.size(); k += 3)
    cloud->viewpoints.emplace_back(&request.viewpoints[k]);
  const InterruptGuard guard;
  ThreadPool pool(request.threads);
  Progress progress("building");
  const auto go_on = [&](double share) {
    progress.at(share);
    return !InterruptGuard::interrupted();
  };
  auto built = request.preset.empty() ? map_build::build_map(*std::move(cloud), config, pool, go_on)
                                      : map_build::build_paper_map(*std::move(cloud), pool, go_on);
  progress.done();
  if (InterruptGuard::interrupted()) return kInterruptedStatus;
  if (!built) return bad_input(built.error());
  const auto& f = built->figures;
  const auto of = [&](ContourKind kind) { return f.by_kind_m[static_cast<std::size_t>(kind)]; };
  const double wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  std::printf(
      "points     %zu, %.1f cm apart, noise %.1f mm, patches of %d%s\n"
      "planes     %zu hold %.1f %% of the points; %zu are facets of curved surfaces\n"
      "creases    %.1f m\nboundaries %.1f m; %.1f m of outlines left out: short or unsure\n"
      "unaligned  %.1f m of shadows, %.1f m of round bodies: %zu cylinders, %zu poles\n"
      "time       %.1f s; normals %.2f, planes %.2f\n",
      f.points, 100 * f.scale.spacing_m, 1e3 * f.scale.noise_m, f.scale.neighbours,
      f.tiles > 1 ? text(", ", f.tiles, " tiles").c_str() : "", f.planes,
      100.0 * static_cast<double>(f.in_planes) / static_cast<double>(f.points), f.curved,
      of(ContourKind::crease), of(ContourKind::boundary), f.left_out_m, of(ContourKind::shadow),
      of(ContourKind::cylinder_axis), f.cylinders, f.poles, wall_s, f.normals_s, f.planes_s);
  return finish_map(std::move(built->map), request);
}

void print_score(const char* name, const KindScore& s) {
  std::printf(
      "%-9s %8.1f %8.1f  %5.1f %5.1f   %5.1f %5.1f   %5.2f %5.2f %5.2f   %5.2f %5.2f  %5.2f %5.2f %5.1f\n",
      name, s.built_m, s.true_m, 100 * s.precision_5mm, 100 * s.precision_10mm, 100 * s.recall_5mm,
      100 * s.recall_10mm, s.p50_mm, s.mean_mm, s.p95_mm, s.direction_mean_deg, s.direction_p95_deg,
      s.sigma_ratio, s.sigma_bulk, 100 * s.outliers);
}

void print_classes(const char* name, const char* unit, double scale, std::span<const RecallClass> classes) {
  std::printf("%s", name);
  for (const RecallClass& c : classes)
    std::printf("   from %.3g %s: %.0f m, %.0f, %.0f", scale * c.from, unit, c.true_m, 100 * c.recall_5mm,
                100 * c.recall_10mm);
  std::printf("\n");
}

struct CompareRequest {
  std::string built, truth, cloud, flown;
};

int compare(const CompareRequest& request) {
  const auto built = read_contour_map(request.built);
  if (!built) return bad_input(built.error());
  const auto truth = read_contour_map(request.truth);
  if (!truth) return bad_input(truth.error());
  PointCloud cloud;
  if (!request.cloud.empty()) {
    auto read = read_cloud(request.cloud);
    if (!read) return bad_input(read.error());
    cloud = *std::move(read);
  }
  MapScoreConfig config;
  if (!request.flown.empty()) {
    const auto poses = read_tum(request.flown);
    if (!poses) return bad_input(poses.error());
    constexpr std::size_t kPlaces = 200;  // are enough for a distance
    for (std::size_t k = 0, step = poses->size() / kPlaces + 1; k < poses->size(); k += step)
      config.flown.push_back((*poses)[k].pose.p);
  }
  const MapScore score = score_map(*built, *truth, request.cloud.empty() ? nullptr : &cloud, config);
  std::printf(
      "          built m   true m  precision %%    recall %%      distance mm         direction deg   error "
      "/ sigma\n"
      "                             5 mm 10 mm    5 mm 10 mm    p50  mean   p95    mean   p95    rms  bulk  "
      "out %%\n");
  print_score("all", score.all);
  print_score("crease", score.crease);
  print_score("boundary", score.boundary);
  std::printf(
      "true contours that do not count: %.1f m of edges under 0.3 m, %.1f m that the cloud did not see\n"
      "recall %% at 5 and 10 mm of those that count\n",
      score.short_m, score.unseen_m);
  print_classes("  by length          ", "m", 1, score.by_length);
  print_classes("  by parallel edge at", "cm", 100, score.by_parallel_edge);
  if (!config.flown.empty()) print_classes("  by distance flown  ", "m", 1, score.by_distance_flown);
  return 0;
}

/// By what is asked for: a whole map, a plan, or one tile of one.
int build_or_plan(const CLI::App& command, const BuildRequest& request, const std::string& plan) {
  if (command.count("--preset") > 0) {
    if (request.preset != "paper")
      return bad_input({"--preset " + request.preset, "there is no such preset", "known: paper"});
    for (const char* other : {"--set", "--viewpoint", "--plan", "--tile"})
      if (command.count(other) > 0)
        return bad_input(
            {other, "does not go with --preset", "the paper's map has no settings and no tiles"});
  }
  if (command.count("--tile") > 0) {
    for (const char* other : {"--set", "--viewpoint", "--output", "--level"})
      if (command.count(other) > 0)
        return bad_input({other, "does not go with --tile",
                          "settings are those of the plan, the rest is told to `map merge`"});
    return build_tile_of(request);
  }
  if (command.count("--plan") == 0) return build(request);
  for (const char* other : {"--viewpoint", "--output", "--level"})
    if (command.count(other) > 0)
      return bad_input(
          {other, "does not go with --plan",
           "--level and --output are told to `map merge`; shadows need the whole cloud at once"});
  BuildRequest planned = request;
  planned.output = plan;
  return plan_tiles(planned);
}

}  // namespace

int finish_map(ContourMap map, const BuildRequest& request) {
  const map_build::UpDirection up = map_build::find_up(map);
  if (request.level && up.known) map_build::level(map, up.up);
  if (const auto ok = write_map_h5(request.output, map); !ok) return bad_input(ok.error());
  print_up(up, request.level);
  print_verdict(map, request.output);
  return 0;
}

void add_map_build(CLI::App& map, std::function<int()>& run) {
  auto request = std::make_shared<BuildRequest>();
  auto plan = std::make_shared<std::string>();
  request->output = "map.h5";
  request->threads = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  auto* command = map.add_subcommand("build", "Make a map from a cloud of surface points (PLY, PCD, LAS)");
  command
      ->add_option("cloud", request->input, "points in metres, of one frame; with --tile a folder of tiles")
      ->required();
  command->add_option("-o,--output", request->output, "map file")->capture_default_str();
  command->add_option("--preset", request->preset,
                      "paper: the map as EV-Pose makes it: traced outlines of grown regions, nothing fitted");
  command->add_option("--set", request->assignments, "one setting, key=value")->allow_extra_args(false);
  command
      ->add_option("--viewpoint", request->viewpoints,
                   "X,Y,Z where a scanner stood, in the cloud's frame; may be given again. What nobody "
                   "could see ends in a shadow, not in an edge")
      ->delimiter(',')
      ->allow_extra_args(false);
  command->add_flag("--level", request->level, "turn the map so that up, as floors and walls say, is z");
  command->add_option("--plan", *plan, "folder to write: the cloud in tiles, each of them a job by itself");
  command
      ->add_option("--tile", request->tile, "build only this tile of a folder that --plan wrote, from 0 on")
      ->check(CLI::Range(0, 100'000'000));
  command->add_option("--threads", request->threads, "that work; the map is the same for any number")
      ->capture_default_str()
      ->check(CLI::Range(1, 256));
  command->callback([=, &run] { run = [=] { return build_or_plan(*command, *request, *plan); }; });
}

void add_map_merge(CLI::App& map, std::function<int()>& run) {
  auto request = std::make_shared<BuildRequest>();
  request->output = "map.h5";
  auto* command = map.add_subcommand("merge", "Make one map of tiles that have been built");
  command->add_option("tiles", request->input, "folder that `map build --plan` wrote")->required();
  command->add_option("-o,--output", request->output, "map file")->capture_default_str();
  command->add_flag("--level", request->level, "turn the map so that up, as floors and walls say, is z");
  command->callback([=, &run] { run = [=] { return merge_tiles(*request); }; });
}

void add_map_compare(CLI::App& map, std::function<int()>& run) {
  auto request = std::make_shared<CompareRequest>();
  auto* command = map.add_subcommand("compare", "How near the contours of a map are to the true ones");
  command->add_option("built", request->built, "map or contours to judge")->required();
  command->add_option("true", request->truth, "true contours")->required();
  command->add_option("--cloud", request->cloud,
                      "cloud it was built from: true edges that it did not see do not count");
  command->add_option("--flown", request->flown,
                      "trajectory (TUM) in the map's frame: recall by the distance from it, too");
  command->callback([=, &run] { run = [=] { return compare(*request); }; });
}

}  // namespace evpose
