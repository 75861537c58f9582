// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/view/pages.h"

#include <cmath>
#include <cstdio>

#define EVPOSE_ASSET(name)                                                          \
  extern "C" const char evpose_asset_##name##_begin[], evpose_asset_##name##_end[]; \
  static std::string name() { return {evpose_asset_##name##_begin, evpose_asset_##name##_end}; }

EVPOSE_ASSET(viewer_html)
EVPOSE_ASSET(viewer_css)
EVPOSE_ASSET(viewer_js)
EVPOSE_ASSET(picture_js)
EVPOSE_ASSET(plots_js)
EVPOSE_ASSET(plotly_js)
EVPOSE_ASSET(three_js)
EVPOSE_ASSET(orbit_js)

namespace evpose {
namespace {

constexpr std::size_t kMostPoints = 30'000, kMostTriangles = 20'000;
constexpr float kNeighbour_m = 0.5f;  // points of a contour that are further apart are not joined

void append(std::string& list, const Eigen::Vector3d& p) {
  char row[96];
  std::snprintf(row, sizeof row, "%s%.3f,%.3f,%.3f", list.back() == '[' ? "" : ",", p.x(), p.y(), p.z());
  list += row;
}

std::string quoted(const std::string& words) {
  std::string out = "\"";
  for (const char c : words) {
    if (c == '"' || c == '\\') out += '\\';
    if (static_cast<unsigned char>(c) >= ' ') out += c;
  }
  return out + "\"";
}

}  // namespace

void set_viewer_pages(Server& server, const std::string& mode) {
  const std::string script = "text/javascript; charset=utf-8";
  server.set_page("/", "text/html; charset=utf-8", viewer_html());
  server.set_page("/viewer.css", "text/css; charset=utf-8", viewer_css());
  server.set_page("/viewer.js", script, viewer_js());
  server.set_page("/picture.js", script, picture_js());
  server.set_page("/plots.js", script, plots_js());
  server.set_page("/three.js", script, three_js());
  // The library's own word for itself is none that a browser knows without being told.
  std::string orbit = orbit_js();
  const std::string name = "from 'three'";
  for (auto at = orbit.find(name); at != std::string::npos; at = orbit.find(name, at))
    orbit.replace(at, name.size(), "from './three.js'");
  server.set_page("/orbit.js", script, std::move(orbit));
  server.set_page("/plotly.js", script, plotly_js());
  server.set_page("/mode.json", "application/json", "{\"mode\":" + quoted(mode) + "}");
  server.set_page("/favicon.ico", "image/x-icon", std::string());
}

std::string scene_json(const ContourMap* map) {
  std::string points = "[", lines = "[", triangles = "[";
  if (map != nullptr && !map->points.empty()) {
    const std::size_t step = map->points.size() / kMostPoints + 1;
    for (std::size_t i = 0; i < map->points.size(); i += step) {
      append(points, map->position(i));
      const std::size_t next = i + step;
      if (next >= map->points.size()) continue;
      const ContourPoint &a = map->points[i], &b = map->points[next];
      // Without numbers of contours, neighbours are those that follow along the tangent.
      const Eigen::Vector3f between = b.position - a.position;
      const float distance = between.norm();
      const bool along = std::abs(between.dot(a.tangent)) > 0.98f * distance;
      if (a.contour != b.contour || distance > kNeighbour_m || !along) continue;
      append(lines, map->position(i));
      append(lines, map->position(next));
    }
    const auto& mesh = map->occluders;
    const std::size_t stride = mesh.triangles.size() / kMostTriangles + 1;
    for (std::size_t i = 0; i < mesh.triangles.size(); i += stride)
      for (const std::uint32_t corner : mesh.triangles[i])
        append(triangles, map->anchor + mesh.vertices[corner].cast<double>());
  }
  return "{\"name\":" + quoted(map ? map->source.substr(map->source.find_last_of('/') + 1) : "") +
         ",\"points\":" + points + "],\"lines\":" + lines + "],\"triangles\":" + triangles + "]}";
}

}  // namespace evpose
