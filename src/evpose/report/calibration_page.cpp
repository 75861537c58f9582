// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/report/calibration_page.h"

#include <algorithm>
#include <cmath>

#include "evpose/report/html_text.h"

namespace evpose {
namespace {

constexpr double kDrawnWidth = 900, kDrawnHeight = 300;  // px of a drawing
constexpr double kLongestArrow = 0.07;                   // of the drawing's width

/// 1, 2 or 5 times a power of ten, at most the value.
double round_length(double value) {
  const double power = std::pow(10, std::floor(std::log10(value)));
  return value / power >= 5 ? 5 * power : value / power >= 2 ? 2 * power : power;
}

std::string svg_head(double height) {
  return formatted(
      "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 %.0f %.0f' font-family='sans-serif' "
      "font-size='12'><rect width='100%%' height='100%%' fill='#fff'/>",
      kDrawnWidth, height);
}

/// Arrows over the image, with a scale of their own.
std::string draw_field(const std::vector<FieldArrow>& arrows, ImageSize size) {
  if (arrows.empty()) return "<p>No part of the image was seen often enough.</p>";
  double longest = 1e-6;
  for (const FieldArrow& a : arrows) longest = std::max(longest, a.offset_px.norm());
  const double scale = kDrawnWidth / size.width, stretch = kLongestArrow * kDrawnWidth / longest;
  const double height = scale * size.height + 30;
  std::string out = svg_head(height);
  out += formatted("<rect x='0.5' y='0.5' width='%.1f' height='%.1f' fill='none' stroke='#bbb'/>",
                   kDrawnWidth - 1, scale * size.height - 1);
  for (const FieldArrow& a : arrows) {
    const Eigen::Vector2d from = scale * a.pixel, to = from + stretch * a.offset_px;
    out += formatted("<path d='M%.1f %.1fL%.1f %.1f' stroke='#0b62a4' stroke-width='1.6'/>", from.x(),
                     from.y(), to.x(), to.y());
    out += formatted("<circle cx='%.1f' cy='%.1f' r='2.2' fill='#0b62a4'/>", from.x(), from.y());
  }
  const double bar = round_length(longest);
  out += formatted(
      "<path d='M20 %.1fh%.1f' stroke='#000' stroke-width='3'/><text x='%.1f' y='%.1f'>%g px</text>",
      height - 12, bar * stretch, 28 + bar * stretch, height - 8, bar);
  return out + "</svg>";
}

std::string draw_radius(const std::vector<RadiusBin>& bins) {
  if (bins.size() < 2) return "<p>Too few contours.</p>";
  double top = 0.05;
  for (const RadiusBin& b : bins) top = std::max({top, std::abs(b.outward_px), b.rms_px});
  const double right = bins.back().radius_px * 1.05;
  const auto at = [&](double radius, double value) {
    return Eigen::Vector2d(60 + (kDrawnWidth - 90) * radius / right,
                           0.5 * kDrawnHeight - 0.43 * kDrawnHeight * value / top);
  };
  std::string out = svg_head(kDrawnHeight + 24), mean, rms;
  for (const RadiusBin& b : bins) {
    const Eigen::Vector2d m = at(b.radius_px, b.outward_px), r = at(b.radius_px, b.rms_px);
    mean += formatted("%c%.1f %.1f", mean.empty() ? 'M' : 'L', m.x(), m.y());
    rms += formatted("%c%.1f %.1f", rms.empty() ? 'M' : 'L', r.x(), r.y());
  }
  for (const double value : {-top, 0.0, top})
    out += formatted("<path d='M60 %.1fH%.0f' stroke='#ddd'/><text x='8' y='%.1f'>%.2f px</text>",
                     at(0, value).y(), kDrawnWidth - 30, at(0, value).y() + 4, value);
  out += "<path d='" + mean + "' stroke='#0b62a4' stroke-width='2' fill='none'/>";
  out += "<path d='" + rms + "' stroke='#d1495b' stroke-width='2' fill='none'/>";
  out += formatted(
      "<text x='60' y='%.0f'>0</text><text x='%.0f' y='%.0f' text-anchor='end'>%.0f px from the "
      "middle</text>",
      kDrawnHeight + 16, kDrawnWidth - 30, kDrawnHeight + 16, right);
  return out +
         "</svg><p><span style='color:#0b62a4'>Blue</span>: mean offset outwards. "
         "<span style='color:#d1495b'>Red</span>: root mean square across the contours.</p>";
}

std::string numbers_table(const std::vector<CalibrationNumber>& numbers) {
  std::string out =
      "<table><tr><th>number<th>given<th>its sigma<th>found<th>sigma<th>change, in given sigmas</tr>";
  for (const CalibrationNumber& n : numbers)
    out += formatted(
        "<tr><td>%s%s%s<td>%.6g<td>%.3g<td>%.6g<td>%.3g<td>%s</tr>", n.name.c_str(),
        n.unit.empty() ? "" : ", ", n.unit.c_str(), n.given, n.given_sigma, n.found, n.sigma,
        n.given_sigma > 0 ? formatted("%.2f", (n.found - n.given) / n.given_sigma).c_str() : "known");
  return out + "</table>";
}

std::string correlation_table(const CalibrationPage& page) {
  const auto count = static_cast<Eigen::Index>(page.numbers.size());
  if (page.correlation.rows() != count) return "";
  std::string out = "<table class='small'><tr><th>";
  for (const CalibrationNumber& n : page.numbers) out += "<th>" + n.name;
  for (Eigen::Index i = 0; i < count; ++i) {
    out += "<tr><td>" + page.numbers[static_cast<std::size_t>(i)].name;
    for (Eigen::Index j = 0; j < count; ++j) {
      const double r = page.correlation(i, j);
      out += formatted("<td style='background:hsl(%d,70%%,%.0f%%)'>%.2f", r < 0 ? 210 : 10,
                       100 - 45 * std::min(1.0, std::abs(r)), r);
    }
  }
  return "<h2>Correlations</h2>" + out + "</table>";
}

std::string motion_table(const CalibrationPage& page) {
  std::string out =
      "<table><tr><th>recording<th>s<th>accepted %<th>turn about x, y, z of the body, deg/s<th>speed "
      "m/s<th>acceleration m/s^2<th>image seen %</tr>";
  for (const FlightMotion& f : page.flights)
    out += formatted("<tr><td>%s<td>%.1f<td>%.0f<td>%.1f, %.1f, %.1f<td>%.2f<td>%.2f<td>%.0f</tr>",
                     escaped_html(f.name).substr(0, 80).c_str(), f.duration_s, 100 * f.accepted,
                     f.rate_deg_s.x(), f.rate_deg_s.y(), f.rate_deg_s.z(), f.speed_m_s, f.acceleration_m_s2,
                     100 * f.coverage);
  return out + "</table>";
}

}  // namespace

std::string calibration_page(const CalibrationPage& page) {
  std::string out = "<!doctype html><html lang='en'><meta charset='utf-8'><title>" +
                    escaped_html(page.title) +
                    "</title><style>body{font:15px/1.45 sans-serif;margin:2em auto;max-width:960px;padding:0 "
                    "1em;color:#222}table{border-collapse:collapse;margin:1em 0}td,th{padding:2px "
                    "10px;border-bottom:1px solid #ddd;text-align:right}td:first-child,th:first-child"
                    "{text-align:left}.small{font-size:11px}.small td,.small th{padding:2px 4px}"
                    "svg{width:100%;height:auto;border:1px solid #ddd}</style><h1>" +
                    escaped_html(page.title) + "</h1><p>" + escaped_html(page.subtitle) + "</p><ul>";
  for (const std::string& words : page.words) out += "<li>" + escaped_html(words);
  out += "</ul><h2>Numbers</h2>" + numbers_table(page.numbers);
  if (!page.imu_axes.empty())
    out += "<h2>Axes of the IMU</h2><p>Scale (xx, yy, zz) and misalignment: what an axis reads of each.</p>" +
           numbers_table(page.imu_axes);
  out +=
      "<h2>The given calibration beside the found one</h2><p>By how much the given one sees things "
      "elsewhere, after the turn of the camera that fits best.</p>" +
      draw_field(page.before, page.size);
  out += "<h2>What is left</h2><p>Mean offset of events from contours with the found calibration.</p>" +
         draw_field(page.after, page.size) + draw_radius(page.radius);
  out += "<h2>Motion</h2><p>Root mean squares.</p>" + motion_table(page);
  return out + correlation_table(page) + "</html>\n";
}

}  // namespace evpose
