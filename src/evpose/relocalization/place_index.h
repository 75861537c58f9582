// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "evpose/map/contour_index.h"
#include "evpose/map/place_table.h"
#include "evpose/map/visible_set.h"

namespace evpose {

/// Which contour points can be seen from where, in all directions: the space of a map is divided into cubes,
/// the places, and the points are those that its middle sees.
class PlaceIndex {
 public:
  /// What a place sees is divided by direction: the sides of a cube, each into squares.
  static constexpr int kSquares = 3, kDirections = 6 * kSquares * kSquares;
  struct Place {
    Eigen::Vector3d middle;                             ///< map frame
    std::array<std::uint32_t, kDirections + 1> begins;  ///< of the directions' ranges
  };

  /// Places over a box of the map frame. `told`, if any, is told what is hidden.
  PlaceIndex(const ContourIndex& index, const VisibleSetConfig& config, const Eigen::AlignedBox3d& box,
             PlaceTable* told = nullptr);
  /// The same as the one that told the table, of that map; the table has as many places as counts_of() its
  /// box.
  PlaceIndex(const ContourIndex& index, const PlaceTable& table);
  /// Edge of a place, of an index over such a box.
  static double edge_m_of(const Eigen::AlignedBox3d& box);
  /// Numbers of places along x, y and z, those that see hardly anything among them.
  static Eigen::Vector3d counts_of(const Eigen::AlignedBox3d& box);

  std::span<const Place> places() const { return places_; }
  /// A point of a contour.
  struct Sample {
    Eigen::Vector3f position;  ///< relative to the map's anchor
    Eigen::Vector3f tangent;   ///< unit
  };
  /// What a place sees in a direction, as numbers of samples.
  std::span<const std::uint32_t> seen_from(const Place& place, int direction) const {
    const auto d = static_cast<std::size_t>(direction);
    return std::span(points_).subspan(place.begins[d], place.begins[d + 1] - place.begins[d]);
  }
  /// Directions with rays within this angle of an axis of the map frame.
  static std::vector<int> directions_around(const Eigen::Vector3d& axis, double angle_rad);
  const Sample& sample(std::uint32_t number) const { return samples_[number]; }
  const Eigen::Vector3d& anchor() const { return anchor_; }  ///< of the map
  double edge_m() const { return edge_m_; }                  ///< of a place

 private:
  friend class PlaceIndexBuilder;

  double edge_m_;
  Eigen::Vector3d anchor_;
  std::vector<Place> places_;
  std::vector<std::uint32_t> points_;
  std::vector<Sample> samples_;
};

/// Around all contours of a map that are aligned to, with room for a camera beside them.
Eigen::AlignedBox3d space_around(const ContourMap& map);

}  // namespace evpose
