// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_learn/map_changes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <tuple>
#include <unordered_map>

#include "evpose/map/contour_segments.h"
#include "evpose/map_learn/median.h"

namespace evpose::map_learn {
namespace {

constexpr double kParallelCos = 0.95;
constexpr double kAlong_m = 0.02;  // by which two samples of one contour may lie beside each other along it
constexpr double kSameLine_m = 2e-3;  // across, between samples of one contour
constexpr double kPaired = 0.3;       // share of a piece's samples that have to have a partner

/// A point of a map in a grid of cubes.
class PointGrid {
 public:
  PointGrid(const ContourMap& map, double cube_m) : map_(map), cube_m_(cube_m) {
    for (std::uint32_t i = 0; i < map.points.size(); ++i)
      if (!is_view_dependent(map.points[i].kind)) cubes_[key(cube_of(map.position(i)))].push_back(i);
  }

  template <class Visit>
  void near(const Eigen::Vector3d& place, const Visit& visit) const {
    const Eigen::Vector3i middle = cube_of(place);
    for (int k = 0; k < 27; ++k) {
      const auto found = cubes_.find(key(middle + Eigen::Vector3i(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1)));
      if (found == cubes_.end()) continue;
      for (const std::uint32_t i : found->second) visit(i);
    }
  }
  const ContourMap& map() const { return map_; }

 private:
  Eigen::Vector3i cube_of(const Eigen::Vector3d& place) const {
    return (place / cube_m_).array().floor().cast<int>();
  }
  static std::int64_t key(const Eigen::Vector3i& cube) {
    constexpr std::int64_t kBits = 21, kMask = (std::int64_t{1} << kBits) - 1;
    return ((cube.x() & kMask) << (2 * kBits)) | ((cube.y() & kMask) << kBits) | (cube.z() & kMask);
  }

  const ContourMap& map_;
  double cube_m_;
  std::unordered_map<std::int64_t, std::vector<std::uint32_t>> cubes_;
};

struct Partner {
  std::uint32_t point = 0;
  Eigen::Vector3d across = Eigen::Vector3d::Zero();  ///< to it, m
};

/// Visits the parallel points of the other map that lie beside this one, with the way across to them.
template <class Visit>
void beside(const ContourMap& map, std::uint32_t i, const PointGrid& others, const Visit& visit) {
  const Eigen::Vector3d place = map.position(i), tangent = map.points[i].tangent.cast<double>();
  const double along_m = std::max(kAlong_m, static_cast<double>(map.points[i].length));
  others.near(place, [&](std::uint32_t k) {
    if (std::abs(others.map().points[k].tangent.cast<double>().dot(tangent)) < kParallelCos) return;
    const Eigen::Vector3d way = others.map().position(k) - place;
    const double along = way.dot(tangent);
    if (std::abs(along) <= along_m) visit(Partner{k, way - along * tangent});
  });
}

/// The nearest one that is not taken.
std::optional<Partner> partner_of(const ContourMap& map, std::uint32_t i, const PointGrid& others,
                                  const std::vector<bool>& taken, double within_m) {
  std::optional<Partner> best;
  beside(map, i, others, [&](const Partner& p) {
    const double off_m = p.across.norm();
    if (!taken[p.point] && off_m <= within_m && (!best || off_m < best->across.norm())) best = p;
  });
  return best;
}

/// The points of each segment; view-dependent ones left out.
std::vector<std::vector<std::uint32_t>> pieces_of(const ContourMap& map) {
  const ContourSegments segments = cut_into_segments(map);
  std::vector<std::vector<std::uint32_t>> out(segments.count);
  for (std::uint32_t i = 0; i < map.points.size(); ++i)
    if (!is_view_dependent(map.points[i].kind)) out[segments.of_point[i]].push_back(i);
  std::erase_if(out, [](const auto& piece) { return piece.empty(); });
  return out;
}

class DateComparison {
 public:
  DateComparison(const ContourMap& before, const ContourMap& after, const ChangeConfig& config)
      : before_(before), after_(after), config_(config), grid_(after, config.farthest_m) {
    taken_.assign(after.points.size(), false);
  }

  MapChanges run();

 private:
  /// The piece's change within that distance; none: it has no partners there. Takes them.
  std::optional<ContourChange> pair(const std::vector<std::uint32_t>& piece, double within_m);
  ContourChange described(const ContourMap& map, const std::vector<std::uint32_t>& piece,
                          Change change) const;

  const ContourMap &before_, &after_;
  const ChangeConfig& config_;
  PointGrid grid_;
  std::vector<bool> taken_;
};

ContourChange DateComparison::described(const ContourMap& map, const std::vector<std::uint32_t>& piece,
                                        Change change) const {
  ContourChange out;
  out.change = change;
  double variance = 0;
  for (const std::uint32_t i : piece) {
    out.middle += map.position(i) / static_cast<double>(piece.size());
    out.length_m += static_cast<double>(map.points[i].length);
    variance +=
        static_cast<double>(map.points[i].sigma * map.points[i].sigma) / static_cast<double>(piece.size());
  }
  out.sigma_m = std::sqrt(variance);
  return out;
}

std::optional<ContourChange> DateComparison::pair(const std::vector<std::uint32_t>& piece, double within_m) {
  std::vector<Partner> partners;
  std::vector<std::uint32_t> paired;
  for (const std::uint32_t i : piece)
    if (const auto partner = partner_of(before_, i, grid_, taken_, within_m))
      partners.push_back(*partner), paired.push_back(i);
  if (static_cast<double>(partners.size()) < kPaired * static_cast<double>(piece.size()) || partners.empty())
    return {};
  ContourChange out = described(before_, piece, Change::moved);
  std::array<std::vector<double>, 3> ways;
  double variance = 0;
  for (std::size_t k = 0; k < partners.size(); ++k) {
    const Partner& p = partners[k];
    // With all samples of the contour on which the partner lies.
    beside(before_, paired[k], grid_, [&](const Partner& other) {
      if ((other.across - p.across).norm() < kSameLine_m) taken_[other.point] = true;
    });
    for (int axis = 0; axis < 3; ++axis) ways[static_cast<std::size_t>(axis)].push_back(p.across(axis));
    const auto sigma = static_cast<double>(after_.points[p.point].sigma);
    variance += sigma * sigma / static_cast<double>(partners.size());
  }
  out.moved_m = {median(ways[0]), median(ways[1]), median(ways[2])};
  out.sigma_m = std::hypot(out.sigma_m, std::sqrt(variance));
  return out;
}

MapChanges DateComparison::run() {
  MapChanges out;
  // Those that stayed take their partners first, then those that moved.
  const auto pieces = pieces_of(before_);
  std::vector<std::optional<ContourChange>> found(pieces.size());
  for (const double within_m : {config_.least_m, 0.02, config_.farthest_m})
    for (std::size_t k = 0; k < pieces.size(); ++k)
      if (!found[k]) found[k] = pair(pieces[k], within_m);
  for (std::size_t k = 0; k < pieces.size(); ++k) {
    const ContourChange change = found[k].value_or(described(before_, pieces[k], Change::gone));
    if (change.change == Change::moved &&
        change.moved_m.norm() < std::max(config_.least_m, 3 * change.sigma_m))
      out.same_m += change.length_m;
    else
      out.changes.push_back(change);
  }
  // Samples that lie beside a partner belong to it, and are not new.
  const PointGrid old(before_, config_.farthest_m);
  const std::vector<bool> none(before_.points.size(), false);
  for (const auto& piece : pieces_of(after_)) {
    const auto known = std::count_if(piece.begin(), piece.end(), [&](std::uint32_t i) {
      return taken_[i] || partner_of(after_, i, old, none, config_.least_m).has_value();
    });
    if (static_cast<double>(known) < kPaired * static_cast<double>(piece.size()))
      out.changes.push_back(described(after_, piece, Change::added));
  }
  // A map file holds the points in another order than they were learnt in.
  std::ranges::sort(out.changes, {}, [](const ContourChange& c) {
    return std::tuple(c.change, c.middle.x(), c.middle.y(), c.middle.z());
  });
  return out;
}

}  // namespace

std::size_t MapChanges::count(Change change) const {
  return static_cast<std::size_t>(std::count_if(changes.begin(), changes.end(),
                                                [&](const ContourChange& c) { return c.change == change; }));
}

double MapChanges::length_m(Change change) const {
  double out = 0;
  for (const ContourChange& c : changes)
    if (c.change == change) out += c.length_m;
  return out;
}

double MapChanges::median_moved_m() const {
  std::vector<double> moves;
  for (const ContourChange& c : changes)
    if (c.change == Change::moved) moves.push_back(c.moved_m.norm());
  return moves.empty() ? 0 : median(std::move(moves));
}

MapChanges compare_dates(const ContourMap& before, const ContourMap& after, const ChangeConfig& config) {
  return DateComparison(before, after, config).run();
}

}  // namespace evpose::map_learn
