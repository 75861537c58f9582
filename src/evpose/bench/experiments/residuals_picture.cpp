// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/bench/experiments/residuals_picture.h"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "evpose/io/files/atomic_file.h"

namespace evpose::experiments {
namespace {

constexpr double kWidth = 900, kMargin = 30;           // of each of the two pictures
constexpr double kCellsPerWidth = 27, kLargest = 0.3;  // cells of 24 px at VGA; px of full colour
constexpr double kLength = 80;                         // of the picture, for a pixel of offset

/// Mean over looks at one place.
struct Place {
  Eigen::Vector2d at = Eigen::Vector2d::Zero(), across = Eigen::Vector2d::Zero();
  double offset_px = 0, looks = 0;  ///< along `across`

  void add(const Eigen::Vector2d& where, const Eigen::Vector2d& direction, double offset) {
    const double side = direction.dot(across) < 0 ? -1 : 1;
    at += where, across += side * direction, offset_px += side * offset, ++looks;
  }
};

/// Blue: along the direction; red: against it.
std::string colour(double offset_px) {
  const double v = std::clamp(offset_px / kLargest, -1.0, 1.0), pale = 205 * (1 - std::abs(v));
  std::ostringstream s;
  s << "rgb(" << std::lround(v < 0 ? 215 : pale) << ',' << std::lround(0.85 * pale) << ','
    << std::lround(v > 0 ? 215 : pale) << ')';
  return s.str();
}

void draw_line(const Eigen::Vector2d& at, const Eigen::Vector2d& way, double offset_px,
               std::ostringstream& s) {
  const Eigen::Vector2d to = at + kLength * offset_px * way;
  s << "<line x1='" << at.x() << "' y1='" << at.y() << "' x2='" << to.x() << "' y2='" << to.y()
    << "' stroke='" << colour(offset_px) << "'/><circle cx='" << at.x() << "' cy='" << at.y()
    << "' r='1.6' fill='" << colour(offset_px) << "'/>\n";
}

/// Offsets in the image, in cells and four directions.
void draw_image(ImageSize size, const std::vector<ContourLook>& looks, std::ostringstream& s) {
  const double scale = kWidth / size.width, cell = size.width / kCellsPerWidth;
  std::map<std::tuple<int, int, int>, Place> places;
  for (const ContourLook& l : looks) {
    const double angle = std::atan2(l.motion.y(), l.motion.x()) / M_PI;  // -1..1
    const int bin = static_cast<int>(std::lround(4 * (angle + 1))) % 4;
    places[{static_cast<int>(l.pixel.x() / cell), static_cast<int>(l.pixel.y() / cell), bin}].add(
        l.pixel, l.motion, l.left_px());
  }
  s << "<rect x='0' y='0' width='" << kWidth << "' height='" << scale * size.height
    << "' fill='none' stroke='#888'/>\n";
  for (const auto& [key, p] : places)
    draw_line(scale * p.at / p.looks, p.across.normalized(), p.offset_px / p.looks, s);
}

/// Offsets along the map's normals, seen from above; returns the height.
double draw_map(const std::vector<ContourLook>& looks, std::ostringstream& s) {
  std::map<std::uint32_t, Place> places;
  Eigen::Vector2d low(1e9, 1e9), high(-1e9, -1e9);
  for (const ContourLook& l : looks) {
    const Eigen::Vector2d at = l.place_map.head<2>();
    places[l.segment].add(at, Eigen::Vector2d::UnitX(), l.motion_side * l.left_px());
    low = low.cwiseMin(at), high = high.cwiseMax(at);
  }
  const double scale = (kWidth - 2 * kMargin) / std::max(0.1, (high - low).x());
  for (const auto& [segment, p] : places) {
    const Eigen::Vector2d at = p.at / p.looks;
    const double offset = p.offset_px / p.looks;
    s << "<circle cx='" << kMargin + scale * (at.x() - low.x()) << "' cy='"
      << kMargin + scale * (high.y() - at.y()) << "' r='" << 1.5 + 8 * std::min(kLargest, std::abs(offset))
      << "' fill='" << colour(offset) << "' fill-opacity='0.7'/>\n";
  }
  return 2 * kMargin + scale * (high - low).y();
}

}  // namespace

Status draw_residuals(const std::string& file, ImageSize size, const std::vector<ContourLook>& looks) {
  if (looks.empty()) return Error{file, "no contour was seen", "give a recording with contours in view"};
  std::ostringstream image, map;
  image.precision(5), map.precision(5);
  draw_image(size, looks, image);
  const double top = kWidth * size.height / size.width + kMargin, height = top + draw_map(looks, map);
  std::ostringstream s;
  s << "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 " << kWidth << ' ' << height
    << "' font-family='sans-serif' font-size='13'>\n<rect width='100%' height='100%' fill='white'/>\n"
    << image.str() << "<text x='8' y='" << top - 8 << "'>Above: image, a line of " << kLength
    << " for a pixel of offset. Below: map from above, blue along the map's normal, red against it, full at "
    << kLargest << " px.</text>\n<g transform='translate(0 " << top << ")'>\n"
    << map.str() << "</g>\n</svg>\n";
  return write_text_file(file, s.str());
}

}  // namespace evpose::experiments
