// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "evpose/core/error.h"
#include "evpose/io/maps/point_table.h"
#include "evpose/map/contour_map.h"
#include "evpose/map/measured_point.h"

namespace evpose {

// PLY 1.0: ascii, binary_little_endian and binary_big_endian are read, binary_little_endian is written.

/// All scalar properties of element `vertex`; list properties and other elements are skipped. Errors name the
/// line of the header or of the ascii data, or the bytes expected and found. Zero vertices are not an error
/// here.
Expected<PointTable> read_ply_vertices(const std::string& path);
/// The same in blocks, so that the memory does not grow with the file.
Status visit_ply_vertices(const std::string& path, const PointBlocks& visit);

/// x y z of each vertex, metres. Errors: not finite (vertex number).
Expected<std::vector<Eigen::Vector3d>> read_ply_points(const std::string& path);

/// Vertices and faces (polygons become fans), coordinates relative to `anchor`. Errors: indices out of range.
Expected<TriangleMesh> read_ply_mesh(const std::string& path, const Eigen::Vector3d& anchor);

/// contours.ply with every property of formats 2.1 that ContourMap holds.
Status write_ply_contours(const std::string& path, const ContourMap& map);

/// Wavefront OBJ of a map: contours as lines (object `contours`), outlines of the planes as closed lines
/// (object `outlines`), map frame, metres.
Status write_obj_map(const std::string& path, const ContourMap& map);

/// A point as a LiDAR gives it.
struct CloudPoint {
  Eigen::Vector3f position = Eigen::Vector3f::Zero();  ///< map frame, metres
  std::uint8_t intensity = 0;                          ///< reflectance, 255 is white
  std::uint16_t scan = 0;                              ///< number of the scan
};
/// x y z as floats, intensity, scan.
Status write_ply_cloud(const std::string& path, const std::vector<CloudPoint>& points);

/// x y z as doubles, sigma and observations.
Status write_ply_measured(const std::string& path, const std::vector<MeasuredPoint>& points);

/// x y z as floats.
Status write_ply_points(const std::string& path, const std::vector<Eigen::Vector3d>& points);

/// Vertices and triangles, in coordinates of the map (`anchor` added), as doubles.
Status write_ply_mesh(const std::string& path, const TriangleMesh& mesh, const Eigen::Vector3d& anchor);

}  // namespace evpose
