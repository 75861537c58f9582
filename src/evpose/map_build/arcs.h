// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

namespace evpose::map_build {

struct Circle {
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  double radius_m = 0;

  /// Outwards positive.
  double distance(const Eigen::Vector2d& p) const { return (p - centre).norm() - radius_m; }
};

/// A place that a curve runs through, and its error across the curve.
struct CurvePlace {
  Eigen::Vector2d place;
  double sigma_m;
};

/// Robust least squares; nothing if there are fewer than three places or they lie on a line.
std::optional<Circle> fit_circle(std::span<const CurvePlace> places);

/// Log likelihood of an arc over straight lines, each line from one corner to the next, with what their free
/// parameters cost; places far off count as outliers in both. `line_of`: number of the straight side that
/// each place would be on; those `needed_anyway` cost nothing. Positive: an arc.
double arc_over_lines(std::span<const CurvePlace> places, const Circle& circle, std::span<const int> line_of,
                      std::span<const int> needed_anyway);

/// Places in a row that an arc explains better than lines.
struct ArcRun {
  std::size_t first, count;
  Circle circle;
  double gain;
};
/// The run with the greatest gain, of `fewest` places or more; places come in pairs, along a curve.
std::optional<ArcRun> likeliest_arc(std::span<const CurvePlace> places, std::span<const int> line_of,
                                    std::size_t fewest);

/// A stretch of a closed line that runs like an arc, as far as cells can tell.
struct ArcStretch {
  std::size_t first = 0, count = 0;  ///< corners of the line; may run over its end
  Circle circle;
};

/// Stretches of a line along cells (`ring`, a corner at each cell) that bend like a circle and turn by more
/// than chance would, the longest turns first; they do not overlap.
std::vector<ArcStretch> find_arcs(const std::vector<Eigen::Vector2d>& ring, double cell_m,
                                  double least_length_m);

}  // namespace evpose::map_build
