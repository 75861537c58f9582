// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_build/board_map.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace evpose {
namespace {

constexpr int kPointsOfSide = 12;        // of a square, none of them at a corner
constexpr double kLongestStep_m = 0.01;  // between them
constexpr int kLeastCount = 2, kMostCount = 1000;
constexpr double kLongest_m = 10;  ///< side of a square: more is given in another unit

/// In the plane of the board: x to the right, z up.
using Place = Eigen::Vector2d;

struct DarkSquare {
  Place corner;  ///< lower left
  double side;
};
struct DarkDisc {
  Place middle;
  double radius;
};

/// A sheet of dark shapes on bright ground, around its middle.
class Sheet {
 public:
  void add(const DarkSquare& square) {
    const Place a = square.corner, u(square.side, 0), v(0, square.side);
    add_side(a, u, -Place::UnitY());
    add_side(a + v, u, Place::UnitY());
    add_side(a, v, -Place::UnitX());
    add_side(a + u, v, Place::UnitX());
  }

  void add(const DarkDisc& disc) {
    const double around = 2 * std::numbers::pi * disc.radius;
    const int count = std::max(4 * kPointsOfSide, static_cast<int>(std::ceil(around / kLongestStep_m)));
    for (int i = 0; i < count; ++i) {
      const double angle = 2 * std::numbers::pi * i / count;
      const Place out(std::cos(angle), std::sin(angle));
      add_point(disc.middle + disc.radius * out, {-out.y(), out.x()}, out, around / count);
    }
    ++contour_;
  }

  ContourMap map() && {
    map_.planes.push_back({-Eigen::Vector3f::UnitY(), 0, static_cast<std::uint32_t>(map_.points.size()), 0});
    return std::move(map_);
  }

 private:
  static Eigen::Vector3f in_space(const Place& p) { return Eigen::Vector3d(p.x(), 0, p.y()).cast<float>(); }

  void add_side(const Place& from, const Place& along, const Place& out) {
    const double length = along.norm();
    const int count = std::max(kPointsOfSide, static_cast<int>(std::ceil(length / kLongestStep_m)));
    for (int i = 0; i < count; ++i)
      add_point(from + (i + 0.5) / count * along, along / length, out, length / count);
    ++contour_;
  }

  /// `out` points from dark to bright.
  void add_point(const Place& at, const Place& along, const Place& out, double length) {
    ContourPoint p;
    p.position = in_space(at);
    p.normal = in_space(out);
    p.tangent = in_space(along);
    p.length = static_cast<float>(length);
    p.contour = contour_;
    p.plane_a = 0;
    p.kind = ContourKind::marking;
    p.contrast = 1;
    map_.points.push_back(p);
  }

  ContourMap map_;
  std::int32_t contour_ = 0;
};

struct NamedLength {
  const char* name;
  double m;
};

Status check(int columns, int rows, std::initializer_list<NamedLength> lengths) {
  if (std::min(columns, rows) < kLeastCount || std::max(columns, rows) > kMostCount)
    return Error{"board", text(columns, "x", rows, " is no board"),
                 text("give from ", kLeastCount, " to ", kMostCount, " columns and rows")};
  for (const auto& [name, length_m] : lengths) {
    if (!(length_m > 0) || !std::isfinite(length_m))
      return Error{"board", text(name, ": ", length_m, " m is no length"), text("give ", name, " in metres")};
    if (length_m > kLongest_m)
      return Error{"board", text(name, ": ", length_m, " m is longer than that of any board"),
                   text("give ", name, " in metres, not millimetres")};
  }
  return {};
}

Expected<ContourMap> map_of(const Checkerboard& b) {
  if (auto ok = check(b.columns, b.rows, {{"--square", b.square_m}}); !ok) return ok.error();
  Sheet sheet;
  const Place corner = -0.5 * b.square_m * Place(b.columns, b.rows);
  for (int row = 0; row < b.rows; ++row)
    for (int column = row % 2; column < b.columns; column += 2)
      sheet.add(DarkSquare{corner + b.square_m * Place(column, row), b.square_m});
  return std::move(sheet).map();
}

Expected<ContourMap> map_of(const AprilGrid& b) {
  if (auto ok = check(b.columns, b.rows, {{"--tag", b.tag_m}, {"--spacing", b.spacing}}); !ok)
    return ok.error();
  Sheet sheet;
  const double gap = b.spacing * b.tag_m, step = b.tag_m + gap;
  const Place corner = -0.5 * (step * Place(b.columns, b.rows) - Place(gap, gap));
  for (int row = 0; row <= b.rows; ++row)
    for (int column = 0; column <= b.columns; ++column) {
      const Place at = corner + step * Place(column, row);
      if (row < b.rows && column < b.columns) sheet.add(DarkSquare{at, b.tag_m});
      sheet.add(DarkSquare{at - Place(gap, gap), gap});
    }
  return std::move(sheet).map();
}

Expected<ContourMap> map_of(const CircleGrid& b) {
  if (auto ok = check(b.columns, b.rows, {{"--distance", b.distance_m}, {"--diameter", b.diameter_m}}); !ok)
    return ok.error();
  const double nearest = b.shifted ? std::numbers::sqrt2 * b.distance_m : b.distance_m;
  if (!(b.diameter_m < nearest))
    return Error{"board", text("discs of ", b.diameter_m, " m at ", nearest, " m touch each other"),
                 "check distance and diameter"};
  Sheet sheet;
  const double step = b.shifted ? 2 * b.distance_m : b.distance_m;
  const Place corner =
      -0.5 * Place(step * (b.columns - 1) + (b.shifted ? b.distance_m : 0), b.distance_m * (b.rows - 1));
  for (int row = 0; row < b.rows; ++row)
    for (int column = 0; column < b.columns; ++column)
      sheet.add(DarkDisc{
          corner + Place(step * column + (b.shifted && row % 2 == 1 ? b.distance_m : 0), b.distance_m * row),
          0.5 * b.diameter_m});
  return std::move(sheet).map();
}

const char *const kHalfTurn = "turned by 180 degrees", *const kQuarterTurn = "turned by 90 degrees";

}  // namespace

Expected<ContourMap> board_map(const Board& board) {
  auto map = std::visit([](const auto& b) { return map_of(b); }, board);
  if (map) map->board = board_words(board);
  return map;
}

std::string board_symmetry(const Board& board) {
  if (const auto* b = std::get_if<Checkerboard>(&board)) {
    if (b->columns == b->rows && b->columns % 2 == 1) return kQuarterTurn;
    return (b->columns + b->rows) % 2 == 0 ? kHalfTurn : "";
  }
  if (const auto* b = std::get_if<AprilGrid>(&board)) return b->columns == b->rows ? kQuarterTurn : kHalfTurn;
  const auto& b = std::get<CircleGrid>(board);
  if (!b.shifted) return b.columns == b.rows ? kQuarterTurn : kHalfTurn;
  // Turned, the discs of a row are where those of a shifted row were.
  return b.rows % 2 == 0 ? kHalfTurn : "";
}

}  // namespace evpose
