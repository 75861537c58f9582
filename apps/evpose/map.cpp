// SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <optional>
#include <set>

#include "commands.h"
#include "evpose/io/files/atomic_file.h"
#include "evpose/io/maps/contour_files.h"
#include "evpose/io/maps/map_h5.h"
#include "evpose/io/maps/ply.h"
#include "evpose/mavlink/frames.h"
#include "evpose/report/map_accuracy.h"
#include "evpose/report/map_page.h"

namespace evpose {
namespace {

/// Where the map that is imported lies in the world, as far as it is told.
struct Placing {
  std::optional<double> heading_deg;
  std::vector<double> origin_llh;
};

int import_map(const std::string& contours, const std::string& occluders, const Placing& placing,
               const std::string& output) {
  auto map = read_contour_map(contours);
  if (!map) return bad_input(map.error());
  auto placement = read_map_placement(contours);
  if (!placement) return bad_input(placement.error());
  if (placing.heading_deg) placement->T_ned_map = ned_from_heading(*placing.heading_deg * M_PI / 180);
  if (const auto& llh = placing.origin_llh; !llh.empty()) {
    if (llh.size() != 3 || std::abs(llh[0]) > 90 || std::abs(llh[1]) > 180)
      return bad_input(
          {"--origin", "is no place on earth", "give latitude,longitude in degrees, height in m"});
    placement->origin_llh = Eigen::Vector3d(llh[0], llh[1], llh[2]);
  }
  if (!occluders.empty()) {
    auto mesh = read_ply_mesh(occluders, map->anchor);
    if (!mesh) return bad_input(mesh.error());
    map->occluders = std::move(*mesh);
  }
  if (const auto ok = write_map_h5(output, *map, "", *placement); !ok) return bad_input(ok.error());
  return 0;
}

/// What flights have told of it, if they have.
void print_learnt(const ContourMap& map) {
  std::vector<int> looks;
  double told_m = 0;
  for (const ContourPoint& p : map.points) {
    if (p.looks == 0) continue;
    looks.push_back(p.looks);
    told_m += static_cast<double>(p.length);
  }
  if (looks.empty() || !map.learnt) return;
  const auto middle = looks.begin() + static_cast<std::ptrdiff_t>(looks.size() / 2);
  std::nth_element(looks.begin(), middle, looks.end());
  const Eigen::Vector3d sigma_mm = 1e3 * map.learnt->covariance.diagonal().head<3>().cwiseMax(0).cwiseSqrt();
  std::printf(
      "flights    told %.1f m, a contour in %d twentieths of a second (median), together within %.1f, "
      "%.1f, %.1f mm (x, y, z, 1 sigma)\n",
      told_m, *middle, sigma_mm.x(), sigma_mm.y(), sigma_mm.z());
}

int print_map(const ContourMap& map) {
  const MapFigures f = figures_of(map);
  std::printf("points     %zu\ncontours   %zu\nlength     %.1f m\n", map.points.size(), f.contours,
              f.length_m);
  for (std::size_t k = 0; k < f.by_kind_m.size(); ++k)
    if (f.by_kind_m[k] > 0)
      std::printf("  %-13s %.1f m%s\n", kContourKindNames[k], f.by_kind_m[k],
                  is_view_dependent(static_cast<ContourKind>(k))
                      ? ", view-dependent: nothing is aligned to them"
                      : "");
  print_learnt(map);
  std::printf("bounds     x %.2f .. %.2f  y %.2f .. %.2f  z %.2f .. %.2f m\n", f.low.x(), f.high.x(),
              f.low.y(), f.high.y(), f.low.z(), f.high.z());
  std::printf("occluders  %zu triangles\nframe      %s\n", map.occluders.triangles.size(), map.frame.c_str());
  return 0;
}

int write_report(const ContourMap& map, const std::string& path, double pitch_deg,
                 std::vector<double> heights_m) {
  if (heights_m.empty()) heights_m = survey_heights(map);
  constexpr int kCells = 20;
  const double pitch = pitch_deg / 57.29577951;
  const AccuracySurvey survey = survey_accuracy(map, survey_camera(), pitch, heights_m, kCells);
  if (const auto ok = write_text_file(path, map_page(map, survey, pitch)); !ok) return bad_input(ok.error());
  return 0;
}

/// By the name's end: .ply contours, .obj lines and outlines, .svg the plan, .h5 the map again.
int export_map(const std::string& input, const std::string& output) {
  const auto map = read_contour_map(input);
  if (!map) return bad_input(map.error());
  Status done = Error{output, "export knows .ply, .obj, .svg and .h5", "choose one of them"};
  if (output.ends_with(".ply")) done = write_ply_contours(output, *map);
  if (output.ends_with(".obj")) done = write_obj_map(output, *map);
  if (output.ends_with(".svg")) done = write_text_file(output, map_drawing(*map, 0));
  if (output.ends_with(".h5")) done = write_map_h5(output, *map);
  return done ? 0 : bad_input(done.error());
}

}  // namespace

MapFigures figures_of(const ContourMap& map) {
  MapFigures out;
  Eigen::Vector3f low = map.points.front().position, high = low;
  std::set<std::int32_t> contours;
  for (const auto& p : map.points) {
    low = low.cwiseMin(p.position), high = high.cwiseMax(p.position);
    out.length_m += static_cast<double>(p.length);
    out.by_kind_m[static_cast<std::size_t>(p.kind)] += static_cast<double>(p.length);
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
  add_map_board(*map, run);
  add_map_depth(*map, run);
  add_map_index(*map, run);
  add_map_learn(*map, run);
  add_map_changes(*map, run);
  add_map_merge(*map, run);
  struct Options {
    std::string input, occluders, output = "map.h5", report;
    Placing placing;
    double pitch_deg = 30;
    std::vector<double> heights_m;
  };
  auto o = std::make_shared<Options>();
  auto* from_contours = map->add_subcommand(
      "import", "Make a map file from contour points (PLY, PCD), or place one in the world");
  from_contours->add_option("contours", o->input, "contours.ply, or any cloud of edge points")->required();
  from_contours->add_option("--occluders", o->occluders, "PLY mesh that hides contours behind it");
  from_contours->add_option("-o,--output", o->output, "map file")->capture_default_str();
  from_contours->add_option("--heading", o->placing.heading_deg,
                            "compass heading of the map's x axis, degrees; default: 90, x is east");
  from_contours
      ->add_option("--origin", o->placing.origin_llh,
                   "of the map: latitude,longitude in degrees, height above the ellipsoid in m")
      ->delimiter(',');
  from_contours->callback(
      [o, &run] { run = [o] { return import_map(o->input, o->occluders, o->placing, o->output); }; });
  auto* info = map->add_subcommand("info", "Counts, lengths and bounds of a map");
  info->add_option("map", o->input, "map.h5, PLY or PCD")->required();
  info->add_option("--report", o->report, "write the quality report, one HTML file");
  info->add_option("--pitch", o->pitch_deg, "of the report's camera, degrees down")->capture_default_str();
  info->add_option("--heights", o->heights_m, "z of the report's cameras, m")->delimiter(',');
  info->callback([o, &run] {
    run = [o] {
      const auto read = read_contour_map(o->input);
      if (!read) return bad_input(read.error());
      const int status = print_map(*read);
      return o->report.empty() ? status : write_report(*read, o->report, o->pitch_deg, o->heights_m);
    };
  });
  auto* write = map->add_subcommand("export", "A map for other programs: .ply, .obj, .svg");
  write->add_option("map", o->input, "map.h5, PLY or PCD")->required();
  write->add_option("-o,--output", o->output, "file")->required();
  write->callback([o, &run] { run = [o] { return export_map(o->input, o->output); }; });
  add_map_compare(*map, run);
}

}  // namespace evpose
