// SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <memory>

#include "commands.h"
#include "evpose/core/log.h"
#include "evpose/io/formats/open_events.h"
#include "evpose/io/maps/cloud_files.h"
#include "evpose/io/maps/contour_files.h"
#include "evpose/io/motion/trajectory.h"
#include "info_parts.h"
#include "input_kind.h"

namespace evpose {
namespace {

bool has_event_stream(const std::string& path) {
  const auto streams = list_streams(path);
  return !streams || std::any_of(streams->begin(), streams->end(),
                                 [](const StreamInfo& s) { return s.kind == StreamKind::events; });
}

/// A file of events and whatever else it holds.
Status describe_event_file(Sheet& sheet, const std::string& path, const std::string& format) {
  std::optional<Span> events;
  if (has_event_stream(path)) {
    const auto span = describe_events(sheet, path, format, {});
    if (!span) return span.error();
    events = *span;
  }
  const auto imu = describe_sensors(sheet, path);
  if (!imu) return imu.error();
  if (events && *imu) compare_spans(sheet, path, *events, **imu);
  return {};
}

Status describe(Sheet& sheet, const std::string& path) {
  const auto kind = kind_of_input(path);
  if (!kind) return kind.error();
  switch (*kind) {
    case InputKind::recording:
      return describe_recording(sheet, path);
    case InputKind::events:
      return describe_event_file(sheet, path, "");
    case InputKind::calibration:
      return describe_calibration(sheet, path);
    case InputKind::map:
      return describe_map(sheet, path);
    case InputKind::imu: {
      const auto span = describe_imu_file(sheet, path);
      return span ? Status() : Status(span.error());
    }
    case InputKind::trajectory: {
      const auto poses = read_trajectory(path);
      if (!poses) return poses.error();
      describe_trajectory(sheet, path, *poses);
      return {};
    }
  }
  return {};
}

/// "path: what": a warning in the shape of a finding.
Error as_finding(const std::string& warning) {
  const std::size_t at = warning.find(": ");
  if (at == std::string::npos) return {"warning", warning, "see what made the file"};
  return {warning.substr(0, at), warning.substr(at + 2), "see what made the file"};
}

int info(const std::string& path, bool json) {
  Sheet sheet;
  sheet.section("", "");
  std::vector<std::string> warnings;
  set_warning_sink([&](const std::string& warning) {
    if (std::find(warnings.begin(), warnings.end(), warning) == warnings.end()) warnings.push_back(warning);
  });
  const Status status = describe(sheet, path);
  set_warning_sink({});
  if (!status) return bad_input(status.error());
  for (const std::string& warning : warnings) sheet.find(as_finding(warning));
  std::fputs(json ? sheet.json().c_str() : sheet.text().c_str(), stdout);
  return 0;
}

}  // namespace

namespace {

std::string bounds_text(const Eigen::Vector3d& low, const Eigen::Vector3d& high) {
  return "x " + fixed(low.x(), 2) + " .. " + fixed(high.x(), 2) + "  y " + fixed(low.y(), 2) + " .. " +
         fixed(high.y(), 2) + "  z " + fixed(low.z(), 2) + " .. " + fixed(high.z(), 2) + " m";
}

/// What is no map of contours may be a cloud to build one from.
Status describe_cloud(Sheet& sheet, const std::string& path, const Error& no_map) {
  const auto cloud = read_cloud(path);
  if (!cloud) return no_map;
  Eigen::Vector3f low = cloud->points.front(), high = low;
  for (const auto& p : cloud->points) low = low.cwiseMin(p), high = high.cwiseMax(p);
  const Eigen::Vector3d l = cloud->anchor + low.cast<double>(), h = cloud->anchor + high.cast<double>();
  sheet.section("cloud: " + path, "cloud");
  sheet.row("points", text(cloud->points.size()), "points", cloud->points.size());
  sheet.row("bounds", bounds_text(l, h), "bounds_m", {l.x(), l.y(), l.z(), h.x(), h.y(), h.z()});
  sheet.find(no_map);
  return {};
}

}  // namespace

Status describe_map(Sheet& sheet, const std::string& path) {
  const auto map = read_contour_map(path);
  if (!map) return describe_cloud(sheet, path, map.error());
  const MapFigures f = figures_of(*map);
  sheet.section("map: " + path, "map");
  sheet.row("points", text(map->points.size()), "points", map->points.size());
  sheet.row("contours", text(f.contours), "contours", f.contours);
  sheet.row("length", fixed(f.length_m, 1) + " m", "length_m", f.length_m);
  sheet.row("bounds", bounds_text(f.low, f.high), "bounds_m",
            {f.low.x(), f.low.y(), f.low.z(), f.high.x(), f.high.y(), f.high.z()});
  sheet.row("occluders", text(map->occluders.triangles.size(), " triangles"), "occluders",
            map->occluders.triangles.size());
  sheet.row("frame", map->frame, "frame", map->frame);
  return {};
}

void add_info(CLI::App& app, std::function<int()>& run) {
  auto* command = app.add_subcommand("info", "Tell what a file or folder holds, and what is wrong with it");
  struct Options {
    std::string path;
    bool json = false;
  };
  auto o = std::make_shared<Options>();
  command
      ->add_option("path", o->path, "recording, data set, bag, events, IMU, trajectory, calibration or map")
      ->required();
  command->add_flag("--json", o->json, "print JSON");
  command->callback([o, &run] { run = [o] { return info(o->path, o->json); }; });
}

}  // namespace evpose
