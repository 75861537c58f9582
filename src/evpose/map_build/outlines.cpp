// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_build/outlines.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>

namespace evpose::map_build {
namespace {

constexpr double kCellSpacings = 2;  // cell size in point spacings: 4 points to a cell
constexpr std::size_t kMostCells = 4'000'000;
constexpr int kSmallestHole = 9;  // cells: smaller ones are gaps between points
constexpr double kSolid = 0.5;    // share of its area that the points of a hiding surface stand for

/// Cells of a plane, with an empty margin around them.
class Grid {
 public:
  Grid(int columns, int rows)
      : columns_(columns),
        rows_(rows),
        filled_(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows), 0) {}
  int columns() const { return columns_; }
  int rows() const { return rows_; }
  bool inside(int c, int r) const { return c >= 0 && r >= 0 && c < columns_ && r < rows_; }
  std::uint8_t& at(int c, int r) {
    return filled_[static_cast<std::size_t>(r) * static_cast<std::size_t>(columns_) +
                   static_cast<std::size_t>(c)];
  }
  bool full(int c, int r) const {
    return inside(c, r) && filled_[static_cast<std::size_t>(r) * static_cast<std::size_t>(columns_) +
                                   static_cast<std::size_t>(c)] != 0;
  }

 private:
  int columns_, rows_;
  std::vector<std::uint8_t> filled_;
};

/// Fills empty cells that have filled ones on both sides, across, along or askew.
void close_gaps(Grid& grid) {
  const Grid before = grid;
  for (int r = 1; r + 1 < grid.rows(); ++r)
    for (int c = 1; c + 1 < grid.columns(); ++c) {
      if (before.full(c, r)) continue;
      int around = 0;
      for (int k = 0; k < 9; ++k) around += before.full(c + k % 3 - 1, r + k / 3 - 1) ? 1 : 0;
      if (around >= 5) grid.at(c, r) = 1;
    }
}

/// The cells whose surroundings the points cover and that have no empty cell beside them. `covered`: share of
/// each cell that its points stand for.
Grid solid_cells(const Grid& grid, const std::vector<double>& covered) {
  Grid well(grid.columns(), grid.rows()), out = well;
  const auto around = [](int k) { return std::pair(k % 3 - 1, k / 3 - 1); };
  for (int r = 1; r + 1 < grid.rows(); ++r)
    for (int c = 1; c + 1 < grid.columns(); ++c) {
      double sum = 0;
      for (int k = 0; k < 9; ++k) {
        const auto [x, y] = around(k);
        sum += covered[static_cast<std::size_t>(r + y) * static_cast<std::size_t>(grid.columns()) +
                       static_cast<std::size_t>(c + x)];
      }
      // Cells at the border have fewer filled ones around.
      int filled = 0;
      for (int k = 0; k < 9; ++k) filled += grid.full(c + around(k).first, r + around(k).second) ? 1 : 0;
      well.at(c, r) = grid.full(c, r) && sum >= kSolid * filled ? 1 : 0;
    }
  for (int r = 1; r + 1 < grid.rows(); ++r)
    for (int c = 1; c + 1 < grid.columns(); ++c) {
      bool inner = true;
      for (int k = 0; k < 9; ++k) inner = inner && well.full(c + around(k).first, r + around(k).second);
      out.at(c, r) = inner ? 1 : 0;
    }
  return out;
}

/// Connected cells of one state; calls visit(cells, touches_margin) for each group.
template <class Visit>
void for_groups(Grid& grid, bool state, const Visit& visit) {
  std::vector<std::uint8_t> seen(
      static_cast<std::size_t>(grid.columns()) * static_cast<std::size_t>(grid.rows()), 0);
  std::vector<std::pair<int, int>> group;
  for (int r = 0; r < grid.rows(); ++r)
    for (int c = 0; c < grid.columns(); ++c) {
      const auto place = [&](int cc, int rr) -> std::uint8_t& {
        return seen[static_cast<std::size_t>(rr) * static_cast<std::size_t>(grid.columns()) +
                    static_cast<std::size_t>(cc)];
      };
      if (grid.full(c, r) != state || place(c, r) != 0) continue;
      group.assign(1, {c, r});
      place(c, r) = 1;
      bool margin = false;
      for (std::size_t k = 0; k < group.size(); ++k) {
        const auto [x, y] = group[k];
        margin = margin || x == 0 || y == 0 || x + 1 == grid.columns() || y + 1 == grid.rows();
        const int dx[4] = {1, -1, 0, 0}, dy[4] = {0, 0, 1, -1};
        for (int n = 0; n < 4; ++n) {
          const int xx = x + dx[n], yy = y + dy[n];
          if (!grid.inside(xx, yy) || grid.full(xx, yy) != state || place(xx, yy) != 0) continue;
          place(xx, yy) = 1;
          group.emplace_back(xx, yy);
        }
      }
      visit(group, margin);
    }
}

/// Rings along the edges between filled and empty cells, the filled on the left. Corners are grid points.
std::vector<std::vector<Eigen::Vector2i>> rings_of(const Grid& grid) {
  // Edge k of a cell leaves its corner k: bottom (to the right), right (up), top (left), left (down).
  constexpr int kStepX[4] = {1, 0, -1, 0}, kStepY[4] = {0, 1, 0, -1};
  constexpr int kOutX[4] = {0, 1, 0, -1}, kOutY[4] = {-1, 0, 1, 0};
  std::vector<std::uint8_t> walked(
      static_cast<std::size_t>(grid.columns()) * static_cast<std::size_t>(grid.rows()), 0);
  const auto bits = [&](int c, int r) -> std::uint8_t& {
    return walked[static_cast<std::size_t>(r) * static_cast<std::size_t>(grid.columns()) +
                  static_cast<std::size_t>(c)];
  };
  std::vector<std::vector<Eigen::Vector2i>> rings;
  for (int r = 0; r < grid.rows(); ++r)
    for (int c = 0; c < grid.columns(); ++c)
      for (int start = 0; start < 4; ++start) {
        if (!grid.full(c, r) || grid.full(c + kOutX[start], r + kOutY[start]) ||
            (bits(c, r) >> start & 1) != 0)
          continue;
        std::vector<Eigen::Vector2i> ring;
        int x = c, y = r, k = start;
        while ((bits(x, y) >> k & 1) == 0) {
          bits(x, y) = static_cast<std::uint8_t>(bits(x, y) | 1U << k);
          const int corner_x = x + (k == 1 || k == 2 ? 1 : 0), corner_y = y + (k == 2 || k == 3 ? 1 : 0);
          ring.emplace_back(corner_x, corner_y);
          // Round the cell's corner: on along the neighbour ahead, or the one askew, or turn left.
          const int ahead_x = x + kStepX[k], ahead_y = y + kStepY[k];
          const int askew_x = ahead_x + kOutX[k], askew_y = ahead_y + kOutY[k];
          if (!grid.full(ahead_x, ahead_y)) {
            k = (k + 1) % 4;
          } else if (grid.full(askew_x, askew_y)) {
            x = askew_x, y = askew_y, k = (k + 3) % 4;
          } else {
            x = ahead_x, y = ahead_y;
          }
        }
        rings.push_back(std::move(ring));
      }
  return rings;
}

void keep_corners(const std::vector<Eigen::Vector2d>& ring, std::size_t begin, std::size_t end,
                  double tolerance, std::vector<bool>& kept) {
  // Between corner `begin` and corner `end`, which may be ring.size() for the first again.
  std::vector<std::pair<std::size_t, std::size_t>> open{{begin, end}};
  while (!open.empty()) {
    const auto [first, last] = open.back();
    open.pop_back();
    const Eigen::Vector2d &a = ring[first], &b = ring[last % ring.size()];
    const double length = (b - a).norm();
    double furthest = tolerance;
    std::size_t at = 0;
    for (std::size_t k = first + 1; k < last; ++k) {
      const Eigen::Vector2d d = ring[k] - a, along = b - a;
      const double off = length > 0 ? std::abs(d.x() * along.y() - d.y() * along.x()) / length : d.norm();
      if (off > furthest) furthest = off, at = k;
    }
    if (at == 0) continue;
    kept[at] = true;
    open.emplace_back(first, at);
    open.emplace_back(at, last);
  }
}

bool contains(const std::vector<Eigen::Vector2d>& ring, const Eigen::Vector2d& p) {
  bool in = false;
  for (std::size_t i = 0, j = ring.size() - 1; i < ring.size(); j = i++)
    if ((ring[i].y() > p.y()) != (ring[j].y() > p.y()) &&
        p.x() <
            (ring[j].x() - ring[i].x()) * (p.y() - ring[i].y()) / (ring[j].y() - ring[i].y()) + ring[i].x())
      in = !in;
  return in;
}

}  // namespace

PlaneFrame::PlaneFrame(const FittedPlane& plane) : origin(plane.centre) {
  // Near the map's axes where it can be, so that walls and floors give short rings.
  const Eigen::Vector3d n = plane.normal;
  const Eigen::Vector3d up = std::abs(n.z()) < 0.8 ? Eigen::Vector3d::UnitZ() : Eigen::Vector3d::UnitX();
  first = up.cross(n).normalized();
  second = n.cross(first);
}

double twice_area(const std::vector<Eigen::Vector2d>& corners) {
  double sum = 0;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Eigen::Vector2d &a = corners[i], &b = corners[(i + 1) % corners.size()];
    sum += a.x() * b.y() - a.y() * b.x();
  }
  return sum;
}

std::vector<Eigen::Vector2d> straightened(const std::vector<Eigen::Vector2d>& ring, double tolerance) {
  if (ring.size() < 4) return ring;
  // Two corners that any straightening keeps: the one furthest from the first, and the one furthest from
  // that.
  const auto furthest = [&](std::size_t from) {
    std::size_t best = 0;
    double distance = -1;
    for (std::size_t k = 0; k < ring.size(); ++k)
      if ((ring[k] - ring[from]).squaredNorm() > distance)
        distance = (ring[k] - ring[from]).squaredNorm(), best = k;
    return best;
  };
  const std::size_t one = furthest(0), two = furthest(one);
  const std::size_t low = std::min(one, two), high = std::max(one, two);
  std::vector<Eigen::Vector2d> turned(ring.begin() + static_cast<std::ptrdiff_t>(low), ring.end());
  turned.insert(turned.end(), ring.begin(), ring.begin() + static_cast<std::ptrdiff_t>(low));
  std::vector<bool> kept(turned.size(), false);
  kept[0] = kept[high - low] = true;
  keep_corners(turned, 0, high - low, tolerance, kept);
  keep_corners(turned, high - low, turned.size(), tolerance, kept);
  std::vector<Eigen::Vector2d> out;
  for (std::size_t k = 0; k < turned.size(); ++k)
    if (kept[k]) out.push_back(turned[k]);
  return out;
}

namespace {

/// Straightened rings of a grid in plane coordinates, outer ones before their holes.
std::vector<Ring> straight_rings(const Grid& grid, const Eigen::Vector2d& low, double cell_m) {
  std::vector<Ring> out, holes;
  for (const auto& corners : rings_of(grid)) {
    std::vector<Eigen::Vector2d> ring;
    for (const auto& corner : corners)
      ring.push_back(low + cell_m * (corner.cast<double>() - Eigen::Vector2d(2, 2)));
    Ring traced;
    traced.corners = straightened(ring, 0.8 * cell_m);
    traced.coarse = straightened(ring, 1.5 * cell_m);
    traced.steps = std::move(ring);
    if (traced.corners.size() < 3) continue;
    (twice_area(traced.corners) > 0 ? out : holes).push_back(std::move(traced));
  }
  const std::size_t outer = out.size();
  for (Ring& hole : holes) {
    // The smallest outer ring around it.
    double smallest = INFINITY;
    for (std::size_t k = 0; k < outer; ++k) {
      const double area = twice_area(out[k].corners);
      if (area < smallest && contains(out[k].corners, hole.corners.front()))
        smallest = area, hole.hole_of = static_cast<int>(k);
    }
    if (hole.hole_of >= 0) out.push_back(std::move(hole));
  }
  return out;
}

}  // namespace

Outline trace_outline(const SurfacePoints& surface, const FittedPlane& plane) {
  Outline out;
  const PlaneFrame frame(plane);
  std::vector<Eigen::Vector2d> flat;
  flat.reserve(plane.points.size());
  for (const std::uint32_t i : plane.points) flat.push_back(frame.flat(surface.position[i].cast<double>()));
  if (flat.empty()) return out;
  Eigen::Vector2d low = flat.front(), high = low;
  for (const auto& p : flat) low = low.cwiseMin(p), high = high.cwiseMax(p);
  const Eigen::Vector2d size = high - low;
  out.cell_m = std::max(kCellSpacings * plane.spacing_m,
                        std::sqrt((size.x() + 0.1) * (size.y() + 0.1) / static_cast<double>(kMostCells)));
  const auto cells = [&](double length) { return static_cast<int>(length / out.cell_m) + 5; };
  Grid grid(cells(size.x()), cells(size.y()));
  std::vector<double> covered(
      static_cast<std::size_t>(grid.columns()) * static_cast<std::size_t>(grid.rows()), 0);
  for (std::size_t k = 0; k < flat.size(); ++k) {
    const int c = static_cast<int>((flat[k].x() - low.x()) / out.cell_m) + 2;
    const int r = static_cast<int>((flat[k].y() - low.y()) / out.cell_m) + 2;
    const double share = static_cast<double>(surface.spacing_m[plane.points[k]]) / out.cell_m;
    grid.at(c, r) = 1;
    covered[static_cast<std::size_t>(r) * static_cast<std::size_t>(grid.columns()) +
            static_cast<std::size_t>(c)] += share * share;
  }
  close_gaps(grid);
  for_groups(grid, false, [&](const auto& group, bool margin) {
    if (!margin && group.size() < kSmallestHole)
      for (const auto& [c, r] : group) grid.at(c, r) = 1;
  });
  for_groups(grid, true, [&](const auto& group, bool) {
    if (group.size() < 4)
      for (const auto& [c, r] : group) grid.at(c, r) = 0;
  });
  out.rings = straight_rings(grid, low, out.cell_m);
  out.solid = straight_rings(solid_cells(grid, covered), low, out.cell_m);
  return out;
}

}  // namespace evpose::map_build
