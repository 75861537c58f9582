// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/report/map_page.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>

#include "evpose/report/html_text.h"

namespace evpose {
namespace {

constexpr double kWidth = 900;    // px of a drawing
constexpr double kTallest = 700;  // px
constexpr std::array<const char*, kContourKinds> kKindColours{"#777777", "#0b62a4", "#d1495b",
                                                              "#8f5fbf", "#e08e0b", "#9aa5a0"};

struct Bounds {
  Eigen::Vector3d low, high;
};

Bounds bounds_of(const ContourMap& map) {
  Bounds out{map.position(0), map.position(0)};
  for (std::size_t i = 1; i < map.points.size(); ++i)
    out.low = out.low.cwiseMin(map.position(i)), out.high = out.high.cwiseMax(map.position(i));
  return out;
}

/// From metres to the drawing; the second axis upwards.
struct Projection {
  int first, second;
  double scale, x0, y1, height;
  Eigen::Vector2d operator()(const Eigen::Vector3d& p) const {
    return {20 + (p[first] - x0) * scale, 20 + (y1 - p[second]) * scale};
  }
};

Projection projection(const Bounds& b, int first, int second) {
  const double width = std::max(b.high[first] - b.low[first], 0.1),
               height = std::max(b.high[second] - b.low[second], 0.1);
  const double scale = std::min((kWidth - 40) / width, (kTallest - 40) / height);
  return {first, second, scale, b.low[first], b.high[second], height * scale + 60};
}

/// A length of 1, 2 or 5 times a power of ten that is about a sixth of the picture.
std::string scale_bar(const Projection& p) {
  const double wanted = kWidth / 6 / p.scale, power = std::pow(10, std::floor(std::log10(wanted)));
  const double metres = wanted / power >= 5 ? 5 * power : wanted / power >= 2 ? 2 * power : power;
  const double y = p.height - 12;
  return formatted(
      "<path d='M20 %.1fh%.1f' stroke='#000' stroke-width='3'/><text x='%.1f' y='%.1f'>%g m</text>", y,
      metres * p.scale, 28 + metres * p.scale, y + 4, metres);
}

std::string draw_polygons(const ContourMap& map, const Projection& at) {
  std::string out;
  for (std::size_t g = 0; g < map.polygons.size(); ++g) {
    if (map.polygons[g].hole_of >= 0) continue;
    std::string path;
    const auto ring = [&](const MapPolygon& polygon) {
      for (std::size_t k = 0; k < polygon.vertices.size(); ++k) {
        const Eigen::Vector2d p = at(map.anchor + polygon.vertices[k].cast<double>());
        path += formatted("%c%.1f %.1f", k == 0 ? 'M' : 'L', p.x(), p.y());
      }
      path += "Z";
    };
    ring(map.polygons[g]);
    for (const auto& hole : map.polygons)
      if (hole.hole_of == static_cast<std::int32_t>(g)) ring(hole);
    out += "<path d='" + path +
           "' fill='#9fb8c8' fill-opacity='.13' fill-rule='evenodd' stroke='#9fb8c8' stroke-opacity='.5'/>";
  }
  return out;
}

std::string draw_contours(const ContourMap& map, const Projection& at) {
  std::array<std::string, kContourKinds> paths;
  for (std::size_t i = 0; i < map.points.size(); ++i) {
    const ContourPoint& p = map.points[i];
    // Each point as the stretch that it stands for; 2 cm where the map does not say.
    const double half = p.length > 0 ? 0.5 * static_cast<double>(p.length) : 0.01;
    const Eigen::Vector3d t = half * p.tangent.cast<double>(), x = map.position(i);
    const Eigen::Vector2d a = at(x - t), b = at(x + t);
    paths[static_cast<std::size_t>(p.kind)] += formatted("M%.1f %.1fL%.1f %.1f", a.x(), a.y(), b.x(), b.y());
  }
  std::string out;
  for (std::size_t k = 0; k < paths.size(); ++k)
    if (!paths[k].empty())
      out += "<path d='" + paths[k] + "' stroke='" + kKindColours[k] + "' stroke-width='1.2' fill='none'/>";
  return out;
}

std::string drawing(const ContourMap& map, const Bounds& bounds, int first, int second) {
  const Projection at = projection(bounds, first, second);
  return formatted(
             "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 %.0f %.0f' font-family='sans-serif' "
             "font-size='12'>"
             "<rect width='100%%' height='100%%' fill='#fff'/>",
             kWidth, at.height) +
         draw_polygons(map, at) + draw_contours(map, at) + scale_bar(at) + "</svg>";
}

/// Green up to 5 mm, yellow at 15, red from 50 on, grey where nothing can be told.
std::string colour_of(double mm) {
  if (!(mm < 1000)) return "#bbbbbb";
  const double share = std::clamp(std::log(mm / 5) / std::log(10.0), 0.0, 1.0);
  return formatted("hsl(%.0f,70%%,%.0f%%)", 120 * (1 - share), 45 + 10 * std::sin(std::numbers::pi * share));
}

std::string heat_map(const AccuracySlice& slice, const ContourMap& map, const Bounds& bounds) {
  const Projection at = projection(bounds, 0, 1);
  std::string out = formatted(
      "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 %.0f %.0f' font-family='sans-serif' "
      "font-size='11'>",
      kWidth, at.height);
  const double side = slice.cell_m * at.scale;
  for (int r = 0; r < slice.rows; ++r)
    for (int c = 0; c < slice.columns; ++c) {
      const ViewAccuracy& cell = slice.cells[static_cast<std::size_t>(r * slice.columns + c)];
      const Eigen::Vector2d corner = at({slice.x0 + c * slice.cell_m, slice.y0 + (r + 1) * slice.cell_m, 0});
      out += formatted(
          "<rect x='%.1f' y='%.1f' width='%.1f' height='%.1f' fill='%s'><title>%.1f mm along (%.2f %.2f "
          "%.2f), %.2f deg, %zu points</title></rect>",
          corner.x(), corner.y(), side, side, colour_of(cell.worst_mm).c_str(), cell.worst_mm,
          cell.worst_axis.x(), cell.worst_axis.y(), cell.worst_axis.z(), cell.angle_deg, cell.points);
      if (side > 26)
        out += cell.worst_mm < 1000
                   ? formatted("<text x='%.1f' y='%.1f' text-anchor='middle'>%.0f</text>",
                               corner.x() + side / 2, corner.y() + side / 2 + 4, cell.worst_mm)
                   : "";
    }
  return out + "<g opacity='.35'>" + draw_contours(map, at) + "</g>" + scale_bar(at) + "</svg>";
}

struct KindFigures {
  double length_m = 0, sigma_sum = 0;
  std::size_t points = 0;
};

std::string kinds_table(const ContourMap& map) {
  std::array<KindFigures, kContourKinds> kinds;
  for (const auto& p : map.points) {
    KindFigures& k = kinds[static_cast<std::size_t>(p.kind)];
    k.length_m += static_cast<double>(p.length);
    k.sigma_sum += static_cast<double>(p.sigma) * static_cast<double>(p.length);
    ++k.points;
  }
  std::string out = "<table><tr><th>kind<th>points<th>length m<th>mean sigma mm</tr>";
  for (std::size_t k = 0; k < kinds.size(); ++k)
    if (kinds[k].points > 0)
      out += formatted("<tr><td style='color:%s'>%s<td>%zu<td>%.1f<td>%.2f</tr>", kKindColours[k],
                       kContourKindNames[k], kinds[k].points, kinds[k].length_m,
                       kinds[k].length_m > 0 ? 1e3 * kinds[k].sigma_sum / kinds[k].length_m : 0.0);
  return out +
         "</table><p>Cylinder axes (of round bodies; sigma is their radius) and shadows depend on the view: "
         "nothing "
         "is aligned to them.</p>";
}

std::string planes_table(const ContourMap& map) {
  if (map.planes.empty()) return "<p>The map has no planes.</p>";
  std::vector<std::size_t> order(map.planes.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](auto a, auto b) { return map.planes[a].inliers > map.planes[b].inliers; });
  double all = 0;
  for (const auto& plane : map.planes) all += plane.inliers;
  std::string out = "<table><tr><th>plane<th>points<th>share %<th>normal<th>rms mm</tr>";
  for (std::size_t k = 0; k < std::min<std::size_t>(12, order.size()); ++k) {
    const MapPlane& plane = map.planes[order[k]];
    const Eigen::Vector3d n = plane.normal.cast<double>();
    out += formatted("<tr><td>%zu<td>%u<td>%.1f<td>%.3f %.3f %.3f<td>%.1f</tr>", order[k], plane.inliers,
                     100 * plane.inliers / all, n.x(), n.y(), n.z(), 1e3 * static_cast<double>(plane.rms));
  }
  return out + "</table>";
}

std::string slice_words(const AccuracySlice& slice) {
  const AccuracyShares shares = shares_of(slice);
  return formatted(
      "<h3>Cameras at z = %.2f m</h3><p>%.0f %% of the cells are good to 5 mm, %.0f %% to 15 mm, %.0f %% to "
      "50 mm; %.0f %% tell no position.</p>",
      slice.height_m, 100 * shares.to_5mm, 100 * shares.to_15mm, 100 * shares.to_50mm, 100 * shares.none);
}

}  // namespace

std::string map_drawing(const ContourMap& map, int view) {
  const Bounds b = bounds_of(map);
  return view == 0 ? drawing(map, b, 0, 1) : view == 1 ? drawing(map, b, 0, 2) : drawing(map, b, 1, 2);
}

std::string map_page(const ContourMap& map, const AccuracySurvey& survey, double pitch_down_rad) {
  const Bounds b = bounds_of(map);
  const std::string name = escaped_html(map.source.substr(map.source.rfind('/') + 1));
  std::string out = "<!doctype html><html lang='en'><meta charset='utf-8'><title>Map " + name +
                    "</title><style>body{font:15px/1.45 sans-serif;margin:2em auto;max-width:960px;padding:0 "
                    "1em;color:#222}"
                    "table{border-collapse:collapse;margin:1em 0}td,th{padding:2px 12px;border-bottom:1px "
                    "solid #ddd;text-align:right}"
                    "td:first-child,th:first-child{text-align:left}svg{width:100%;height:auto;border:1px "
                    "solid #ddd}</style><h1>Map " +
                    name + "</h1>";
  out += formatted(
      "<p>%zu contour points, %zu planes, %zu occluding triangles; %.1f x %.1f x %.1f m, frame %s.</p>",
      map.points.size(), map.planes.size(), map.occluders.triangles.size(), b.high.x() - b.low.x(),
      b.high.y() - b.low.y(), b.high.z() - b.low.z(), escaped_html(map.frame.substr(0, 60)).c_str());
  out += kinds_table(map);
  out += "<h2>Plan</h2>" + drawing(map, b, 0, 1) + "<h2>Elevation, seen along y</h2>" +
         drawing(map, b, 0, 2) + "<h2>Elevation, seen along x</h2>" + drawing(map, b, 1, 2);
  out += "<h2>Largest planes</h2>" + planes_table(map);
  out += "<h2>Expected accuracy of the pose</h2>";
  out += formatted(
      "<p>One sigma of the position along its worst axis, mm, from the information in the visible contours: "
      "a 640 x 480 "
      "camera of 460 px focal length, %.0f deg down, the better middle of four headings. Points of a 32 px "
      "cell and one "
      "direction share 0.35 px and the map's own sigma. Green is 5 mm, yellow 15, red 50 and more, grey "
      "tells nothing. "
      "A query of the visible set took %.2f ms with this; the spatial index holds %.1f MB.</p>",
      pitch_down_rad * 180 / std::numbers::pi, survey.query_ms,
      static_cast<double>(survey.index_bytes) / 1e6);
  for (const auto& slice : survey.slices) out += slice_words(slice) + heat_map(slice, map, b);
  return out + "</html>\n";
}

}  // namespace evpose
