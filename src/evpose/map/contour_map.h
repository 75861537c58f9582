// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace evpose {

/// Numbers as in the files. A cylinder axis stands for a round body, with the body's radius for sigma. A
/// shadow is where a surface merely stops being seen by the scanner.
enum class ContourKind : std::uint8_t {
  unknown = 0,
  crease = 1,
  boundary = 2,
  marking = 3,
  cylinder_axis = 4,
  shadow = 5
};
inline constexpr std::array<const char*, 6> kContourKindNames{"unknown", "crease",        "boundary",
                                                              "marking", "cylinder_axis", "shadow"};
inline constexpr std::size_t kContourKinds = kContourKindNames.size();

/// Later versions' kinds are unknown ones.
constexpr ContourKind contour_kind(std::uint8_t number) {
  return number < kContourKinds ? static_cast<ContourKind>(number) : ContourKind::unknown;
}

/// View-dependent contours are in the map for people to see: silhouettes of round bodies move with the
/// camera, shadows with the scanner. Nothing is aligned to them.
constexpr bool is_view_dependent(ContourKind kind) {
  return kind == ContourKind::cylinder_axis || kind == ContourKind::shadow;
}

/// A sample of a 3D contour (formats: contours.ply, map.h5).
struct ContourPoint {
  Eigen::Vector3f position;  ///< relative to ContourMap::anchor, metres
  Eigen::Vector3f normal =
      Eigen::Vector3f::Zero();  ///< unit, in the surface, across the edge, pointing out of it
  Eigen::Vector3f tangent = Eigen::Vector3f::Zero();  ///< unit, along the contour; never zero in a valid map
  float length = 0;                         ///< metres of contour that this point stands for; 0 unknown
  float sigma = 0;                          ///< position error across the contour, 1 sigma, metres
  std::int32_t contour = -1;                ///< number of the contour, -1: isolated point
  std::int32_t plane_a = -1, plane_b = -1;  ///< adjacent planes, -1: none
  ContourKind kind = ContourKind::unknown;
  std::int8_t contrast = 0;  ///< brightness step when crossing along normal: -1, 0, +1
  std::uint16_t looks = 0;   ///< of a twentieth of a second in which flights have told its place; 65535: more
  Eigen::Vector3f normal_b = Eigen::Vector3f::Zero();  ///< as normal, in plane b; zero: none or unknown
  /// Mean over the looks of the unit vector towards the camera, map frame: the shorter, the wider apart.
  Eigen::Vector3f seen_from = Eigen::Vector3f::Zero();
};

/// What all that flights have told of a map has in common: it may be displaced, and turned about a point.
struct LearntFrame {
  Eigen::Vector3d about = Eigen::Vector3d::Zero();  ///< map frame, metres
  /// Of displacement and turn, map frame, m and rad.
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
};

/// A flat surface of the map: normal . x + d = 0 with x relative to ContourMap::anchor.
struct MapPlane {
  Eigen::Vector3f normal = Eigen::Vector3f::UnitZ();  ///< unit, towards the free side where that is known
  double d = 0;                                       ///< metres
  std::uint32_t inliers = 0;                          ///< points that it was fitted to
  float rms = 0;                                      ///< of these across it, metres
};

/// A closed line around a surface or around a hole in it. Vertices relative to ContourMap::anchor, metres,
/// not repeated at the end; counter-clockwise seen from where the plane's normal points to, holes clockwise.
struct MapPolygon {
  std::vector<Eigen::Vector3f> vertices;
  std::int32_t plane = -1;
  std::int32_t hole_of = -1;  ///< polygon that it cuts, -1: outer ring
};

/// Surfaces that hide contours behind them. Vertices relative to ContourMap::anchor, metres.
struct TriangleMesh {
  std::vector<Eigen::Vector3f> vertices;
  std::vector<std::array<std::uint32_t, 3>> triangles;  ///< both sides hide
};

/// Where a part of the map by place ends; it begins where the one before ends. Contours, planes and polygons
/// lie in one page each, with all that they name.
struct MapPage {
  std::uint32_t points_end = 0, planes_end = 0, polygons_end = 0;
};

/// The prior map: contours in the map frame. Coordinates are floats relative to an anchor, so that their
/// rounding stays below 0.1 mm within 1 km of it.
struct ContourMap {
  Eigen::Vector3d anchor = Eigen::Vector3d::Zero();  ///< map frame, metres
  std::vector<ContourPoint> points;
  std::vector<MapPlane> planes;
  std::vector<MapPolygon> polygons;    ///< of the planes; they hide what is behind (triangulated())
  TriangleMesh occluders;              ///< empty: nothing is hidden
  std::vector<MapPage> pages;          ///< empty: the map is not divided
  std::vector<std::uint32_t> numbers;  ///< of the points in the map that this is a part of, ascending; empty:
                                       ///< it is a whole
  std::optional<LearntFrame> learnt;   ///< of the points with looks; none: flights have told nothing
  std::string frame = "map";           ///< name of the map frame
  std::string board;                   ///< board_words() of the printed board that it is; empty: it is none
  std::string source;                  ///< file it was read from, for messages

  Eigen::Vector3d position(std::size_t i) const { return anchor + points[i].position.cast<double>(); }
  std::uint32_t number(std::uint32_t i) const { return numbers.empty() ? i : numbers[i]; }
};

}  // namespace evpose
