// SPDX-License-Identifier: BSD-3-Clause
// Maps: contours.ply, clouds that become maps, map.h5.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <chrono>
#include <cmath>
#include <numbers>
#include <thread>

#include "evpose/io/files/test_files.h"
#include "evpose/io/hdf5/hdf5_file.h"
#include "evpose/io/maps/contour_files.h"
#include "evpose/io/maps/map_h5.h"
#include "evpose/io/maps/map_places.h"
#include "evpose/io/maps/ply.h"

namespace evpose {
namespace {

/// Two contours and three isolated points, everything filled in.
ContourMap small_map() {
  ContourMap map;
  map.anchor = {100, -50, 3};
  const auto add = [&](const Eigen::Vector3f& p, std::int32_t contour, ContourKind kind, std::int32_t plane) {
    ContourPoint point;
    point.position = p;
    point.tangent = {1, 0, 0};
    point.normal = {0, 0, 1};
    point.length = 0.01F;
    point.sigma = 0.002F;
    point.contour = contour;
    point.kind = kind;
    point.plane_a = plane;
    point.contrast = -1;
    map.points.push_back(point);
  };
  for (int i = 0; i < 20; ++i) add({0.01F * static_cast<float>(i), 0, 0}, 0, ContourKind::crease, 3);
  for (int i = 0; i < 10; ++i) add({0.01F * static_cast<float>(i), 1, 0}, 1, ContourKind::boundary, 4);
  for (int i = 0; i < 3; ++i) add({0.01F * static_cast<float>(i), 2, 0}, -1, ContourKind::marking, -1);
  // The ends stand for half as much.
  map.points[0].length = map.points[19].length = map.points[20].length = map.points[29].length = 0.005F;
  return map;
}

void expect_same(const ContourMap& a, const ContourMap& b) {
  ASSERT_EQ(a.points.size(), b.points.size());
  for (std::size_t i = 0; i < a.points.size(); ++i) {
    EXPECT_LT((a.position(i) - b.position(i)).norm(), 1e-5) << i;
    EXPECT_LT((a.points[i].tangent - b.points[i].tangent).norm(), 1e-6F);
    EXPECT_LT((a.points[i].normal - b.points[i].normal).norm(), 1e-6F);
    EXPECT_NEAR(a.points[i].length, b.points[i].length, 1e-6F) << i;
    EXPECT_EQ(a.points[i].sigma, b.points[i].sigma);
    EXPECT_EQ(a.points[i].contour, b.points[i].contour);
    EXPECT_EQ(a.points[i].kind, b.points[i].kind);
    EXPECT_EQ(a.points[i].plane_a, b.points[i].plane_a);
    EXPECT_EQ(a.points[i].plane_b, b.points[i].plane_b);
    EXPECT_EQ(a.points[i].contrast, b.points[i].contrast);
  }
}

std::string ascii_ply(const std::string& properties, const std::vector<std::string>& rows) {
  std::string out = "ply\nformat ascii 1.0\nelement vertex " + std::to_string(rows.size()) + "\n";
  std::vector<std::string> names;
  std::string name;
  for (const char c : properties + " ") {
    if (c != ' ') {
      name += c;
      continue;
    }
    out += "property float " + name + "\n";
    name.clear();
  }
  out += "end_header\n";
  for (const auto& row : rows) out += row + "\n";
  return out;
}

TEST(ContourPly, WrittenMapsReadBack) {
  const TemporaryFolder folder;
  const ContourMap map = small_map();
  ASSERT_TRUE(write_ply_contours(folder / "contours.ply", map).ok());
  const auto again = read_contour_map(folder / "contours.ply");
  ASSERT_TRUE(again.ok()) << error_line(again);
  expect_same(map, *again);
  EXPECT_EQ(again->anchor, Eigen::Vector3d(100, -49, 3));  // centre of the box to the metre
  EXPECT_EQ(again->source, folder / "contours.ply");
}

TEST(ContourPly, MissingTangentsAndLengthsComeFromNeighbours) {
  const TemporaryFolder folder;
  // A square of 1 m, a point each centimetre, in the plane z = 2; normals in the plane, outwards.
  std::vector<std::string> rows;
  for (int side = 0; side < 4; ++side) {
    const Eigen::AngleAxisd turn(side * std::numbers::pi / 2, Eigen::Vector3d::UnitZ());
    for (int i = 0; i < 100; ++i) {
      const Eigen::Vector3d p = turn * Eigen::Vector3d(0.5, -0.495 + 0.01 * i, 2),
                            n = turn * Eigen::Vector3d(1, 0, 0);
      rows.push_back(text(p.x(), " ", p.y(), " ", p.z(), " ", n.x(), " ", n.y(), " ", n.z()));
    }
  }
  const auto map = read_contour_map(folder.file("a.ply", ascii_ply("x y z nx ny nz", rows)));
  ASSERT_TRUE(map.ok()) << error_line(map);
  ASSERT_EQ(map->points.size(), 400u);
  double length = 0;
  for (std::size_t i = 0; i < 400; ++i) {
    const auto& p = map->points[i];
    const auto side = static_cast<int>(i / 100);
    const Eigen::AngleAxisd turn(side * std::numbers::pi / 2, Eigen::Vector3d::UnitZ());
    EXPECT_NEAR(std::abs(p.tangent.cast<double>().dot(turn * Eigen::Vector3d(0, 1, 0))), 1, 1e-4) << i;
    length += p.length;
  }
  EXPECT_NEAR(length, 4, 0.05);
}

TEST(ContourPly, CloudsWithoutNormalsKeepTheirTangents) {
  const TemporaryFolder folder;
  std::vector<std::string> rows;
  for (int i = 0; i < 50; ++i) rows.push_back(text(0.02 * i, " ", 0.01 * i, " 1"));
  rows.emplace_back("50 50 50");  // alone
  const auto map = read_contour_map(folder.file("a.ply", ascii_ply("x y z", rows)));
  ASSERT_TRUE(map.ok()) << error_line(map);
  EXPECT_EQ(map->points.size(), 50u);
  for (const auto& p : map->points) {
    EXPECT_NEAR(std::abs(p.tangent.dot(Eigen::Vector3f(2, 1, 0).normalized())), 1, 1e-4);
    EXPECT_TRUE(p.normal.isZero());
  }
}

TEST(ContourPly, SlightlyWrongDirectionsArePutRight) {
  const TemporaryFolder folder;
  const auto map =
      read_contour_map(folder.file("a.ply", ascii_ply("x y z nx ny nz tx ty tz length",
                                                      {"0 0 0 0 0.5 0.1 0 0 2 1", "1 0 0 0 0 0 1 0 0 1"})));
  ASSERT_TRUE(map.ok()) << error_line(map);
  EXPECT_LT((map->points[0].tangent - Eigen::Vector3f(0, 0, 1)).norm(), 1e-6F);
  EXPECT_LT((map->points[0].normal - Eigen::Vector3f(0, 1, 0)).norm(), 1e-6F);
  EXPECT_TRUE(map->points[1].normal.isZero());
}

TEST(ContourPly, ErrorsNameThePoint) {
  const TemporaryFolder folder;
  const auto error = [&](const std::string& properties, const std::vector<std::string>& rows) {
    return error_line(read_contour_map(folder.file("a.ply", ascii_ply(properties, rows))));
  };
  EXPECT_TRUE(says(error("x y z", {}), {"a.ply", "empty"}));
  EXPECT_TRUE(says(error("x y", {"1 2"}), {"x, y and z"}));
  EXPECT_TRUE(
      says(error("x y z nx ny nz", {"0 0 0 1 0 0", "0 nan 0 1 0 0"}), {"point 1 ", "y is not finite"}));
  EXPECT_TRUE(says(error("x y z", {"0 0 0", "0 0 1e9"}), {"point 1 ", "origin"}));
  EXPECT_TRUE(says(error("x y z contour", {"0 0 0 0.5"}), {"point 0 ", "contour = 0.5"}));
  EXPECT_TRUE(says(error("x y z sigma", {"0 0 0 -1"}), {"point 0 ", "sigma = -1"}));
  EXPECT_TRUE(says(error("x y z", {"0 0 0", "1 5 2", "9 1 7"}), {"neighbours"}));
  EXPECT_TRUE(says(error("x y z", {"0 0 0", "0 0 0", "0 0 0"}), {"neighbours"}));
  EXPECT_TRUE(says(error_line(read_contour_map(folder / "none.ply")), {"none.ply", "no such file"}));
  EXPECT_TRUE(says(error_line(read_contour_map(folder.file("a.obj", "v 1 2 3\n"))), {"a.obj", "PLY"}));
}

TEST(ContourPly, GradientColumnsAreToldApart) {
  const TemporaryFolder folder;
  std::vector<std::string> points, directions, half_turned, other_frame;
  for (int i = 0; i < 100; ++i) {
    const double x = 0.01 * i;
    points.push_back(text(x, " 1 5 ", x, " 1.02 5"));
    directions.push_back(text(x, " 1 5 0 1 0"));
    half_turned.push_back(text(x, " 1 5 ", x, " -1.02 -5"));
    other_frame.push_back(text(x, " 1 5 1.02 -5 ", -x));
  }
  for (const auto& rows : {points, directions, half_turned}) {
    const auto map = read_contour_map(folder.file("a.ply", ascii_ply("x y z xg yg zg", rows)));
    ASSERT_TRUE(map.ok()) << error_line(map);
    EXPECT_NEAR(std::abs(map->points[50].normal.y()), 1, 1e-4);
    EXPECT_NEAR(std::abs(map->points[50].tangent.x()), 1, 1e-4);
  }
  EXPECT_TRUE(
      says(error_line(read_contour_map(folder.file("a.ply", ascii_ply("x y z xg yg zg", other_frame)))),
           {"xg yg zg", "another frame"}));
}

TEST(ContourPcd, NormalsOfPointNormalClouds) {
  const TemporaryFolder folder;
  std::string content =
      "VERSION .7\nFIELDS x y z normal_x normal_y normal_z\nSIZE 4 4 4 4 4 4\nTYPE F F F F F F\n"
      "COUNT 1 1 1 1 1 1\nWIDTH 30\nHEIGHT 1\nPOINTS 30\nDATA ascii\n";
  for (int i = 0; i < 30; ++i) content += text(0.01 * i, " 0 1 0 0 1\n");
  const auto map = read_contour_map(folder.file("a.pcd", content));
  ASSERT_TRUE(map.ok()) << error_line(map);
  EXPECT_EQ(map->points[3].normal, Eigen::Vector3f(0, 0, 1));
  EXPECT_NEAR(std::abs(map->points[3].tangent.x()), 1, 1e-5);
}

TEST(ContourPly, SharedMapsAreRead) {
  const std::string data = shared_folder() + "/data/";
  EVPOSE_NEEDS_SHARED(data);
  const auto room = read_contour_map(data + "peer/maps/room_contours.ply");
  ASSERT_TRUE(room.ok()) << error_line(room);
  EXPECT_GT(room->points.size(), 86483u * 99 / 100);
  for (const auto& p : room->points) {
    ASSERT_NEAR(p.tangent.norm(), 1, 1e-5);
    ASSERT_NEAR(p.normal.dot(p.tangent), 0, 1e-5);
    ASSERT_GT(p.length, 0);
  }
  // Second points in another frame, contours as bands of points.
  const auto sofa = read_contour_map(data + "real/clouds/vector_sofa_semi_dense.ply");
  ASSERT_TRUE(sofa.ok()) << error_line(sofa);
  EXPECT_GT(sofa->points.size(), 65026u * 3 / 4);
  const auto office = read_contour_map(data + "real/clouds/office_edges_derived.ply");
  EXPECT_TRUE(office.ok()) << error_line(office);
}

TEST(MapH5, WrittenMapsReadBack) {
  const TemporaryFolder folder;
  ContourMap map = small_map();
  map.frame = "hall";
  map.occluders.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  map.occluders.triangles = {{0, 1, 2}};
  ASSERT_TRUE(write_map_h5(folder / "map.h5", map, "2024-01-31T12:00:00Z").ok());
  const auto again = read_map_h5(folder / "map.h5");
  ASSERT_TRUE(again.ok()) << error_line(again);
  expect_same(map, *again);
  EXPECT_EQ(again->anchor, map.anchor);
  EXPECT_EQ(again->frame, "hall");
  EXPECT_EQ(again->occluders.vertices, map.occluders.vertices);
  EXPECT_EQ(again->occluders.triangles, map.occluders.triangles);
  const auto complete = read_contour_map(folder / "map.h5");
  ASSERT_TRUE(complete.ok()) << error_line(complete);
  EXPECT_EQ(complete->points.size(), map.points.size());
}

TEST(MapH5, WhatFlightsHaveToldIsKept) {
  const TemporaryFolder folder;
  ContourMap map = small_map();
  ASSERT_TRUE(write_map_h5(folder / "untold.h5", map).ok());
  map.points[0].looks = 300;
  map.points[0].seen_from = {0.1F, -0.7F, 0.6F};
  LearntFrame& frame = map.learnt.emplace();
  frame.about = {1, 2, 3};
  for (int i = 0; i < 6; ++i) frame.covariance(i, i) = 1e-6 * (i + 1);
  frame.covariance(1, 4) = frame.covariance(4, 1) = 1e-7;
  ASSERT_TRUE(write_map_h5(folder / "told.h5", map).ok());
  const auto untold = read_map_h5(folder / "untold.h5"), told = read_map_h5(folder / "told.h5");
  ASSERT_TRUE(untold.ok() && told.ok()) << error_line(untold) << error_line(told);
  EXPECT_FALSE(untold->learnt);
  EXPECT_EQ(untold->points[0].looks, 0);
  ASSERT_TRUE(told->learnt);
  EXPECT_EQ(told->learnt->about, frame.about);
  EXPECT_EQ(told->learnt->covariance, frame.covariance);
  int points = 0;
  for (const ContourPoint& p : told->points) {
    if (p.looks == 0) continue;
    ++points;
    EXPECT_EQ(p.seen_from, map.points[0].seen_from);
    EXPECT_EQ(p.looks, 300);
  }
  EXPECT_EQ(points, 1);
  map.learnt->covariance(1, 4) = map.learnt->covariance(4, 1) = 1;
  ASSERT_TRUE(write_map_h5(folder / "off.h5", map).ok());
  EXPECT_TRUE(says(error_line(read_map_h5(folder / "off.h5")), {"off.h5", "learnt_covariance"}));
}

TEST(MapH5, WhereAMapLiesInTheWorldIsKept) {
  const TemporaryFolder folder;
  ASSERT_TRUE(write_map_h5(folder / "plain.h5", small_map()).ok());
  const auto plain = read_map_placement(folder / "plain.h5");
  ASSERT_TRUE(plain.ok()) << error_line(plain);
  EXPECT_FALSE(plain->T_ned_map || plain->origin_llh);
  MapPlacement placement;
  placement.T_ned_map = Pose{so3::exp({0.1, -0.2, 2.0}), {5, -6, 7}};
  placement.origin_llh = Eigen::Vector3d(47.397, 8.545, 488.25);
  ASSERT_TRUE(write_map_h5(folder / "placed.h5", small_map(), "", placement).ok());
  const auto again = read_map_placement(folder / "placed.h5");
  ASSERT_TRUE(again.ok()) << error_line(again);
  ASSERT_TRUE(again->T_ned_map && again->origin_llh);
  EXPECT_LT((again->T_ned_map->matrix() - placement.T_ned_map->matrix()).cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_EQ(*again->origin_llh, *placement.origin_llh);
  EXPECT_TRUE(read_map_h5(folder / "placed.h5").ok());  // the checksum covers it
  placement.origin_llh = Eigen::Vector3d(91, 0, 0);
  ASSERT_TRUE(write_map_h5(folder / "off.h5", small_map(), "", placement).ok());
  EXPECT_TRUE(says(error_line(read_map_placement(folder / "off.h5")), {"off.h5", "origin_llh"}));
  const auto no_map = read_map_placement(folder.file("points.ply", "ply\n"));
  EXPECT_TRUE(no_map.ok() && !no_map->T_ned_map);
}

TEST(MapH5, WhatIsSeenFromPlacesIsKept) {
  const TemporaryFolder folder;
  const ContourMap map = in_file_order(small_map());
  PlaceTable places{view_fingerprint(map),
                    0.1,
                    40,
                    0.17,
                    {Eigen::Vector3d(0, 1, 2), Eigen::Vector3d(3, 4, 5)},
                    {9, PlaceTable::kNoPlace, 8},
                    {0xA5, 1, 0x3C}};
  ASSERT_TRUE(write_map_h5(folder / "map.h5", map, "", {}, &places).ok());
  const auto again = read_map_h5(folder / "map.h5");
  ASSERT_TRUE(again.ok()) << error_line(again);
  EXPECT_EQ(view_fingerprint(*again), places.view);
  const auto read = read_map_places(folder / "map.h5");
  ASSERT_TRUE(read.ok() && *read) << error_line(read);
  EXPECT_EQ((*read)->view, places.view);
  EXPECT_EQ((*read)->near_m, places.near_m);
  EXPECT_EQ((*read)->far_m, places.far_m);
  EXPECT_EQ((*read)->grazing_sin, places.grazing_sin);
  EXPECT_EQ((*read)->box.min(), places.box.min());
  EXPECT_EQ((*read)->box.max(), places.box.max());
  EXPECT_EQ((*read)->looked_at, places.looked_at);
  EXPECT_EQ((*read)->seen, places.seen);
  places.seen.pop_back();
  ASSERT_TRUE(write_map_h5(folder / "short.h5", map, "", {}, &places).ok());
  EXPECT_TRUE(says(error_line(read_map_places(folder / "short.h5")), {"short.h5", "/places", "2 bytes"}));
  ASSERT_TRUE(write_map_h5(folder / "none.h5", map).ok());
  const auto none = read_map_places(folder / "none.h5");
  EXPECT_TRUE(none.ok() && !*none);
}

TEST(MapH5, SameMapSameBytes) {
  const TemporaryFolder folder;
  ASSERT_TRUE(write_map_h5(folder / "a.h5", small_map()).ok());
  std::this_thread::sleep_for(std::chrono::milliseconds(1100));  // HDF5 would note the second
  ASSERT_TRUE(write_map_h5(folder / "b.h5", small_map()).ok());
  EXPECT_TRUE(content_of(folder / "a.h5") == content_of(folder / "b.h5"));
}

TEST(MapH5, MixedContoursAreGroupedAndSplit) {
  const TemporaryFolder folder;
  ContourMap map = small_map();
  std::swap(map.points[5], map.points[25]);    // contours 0 and 1 interleaved
  map.points[10].kind = ContourKind::marking;  // contour 0 in three pieces
  ASSERT_TRUE(write_map_h5(folder / "map.h5", map).ok());
  const auto again = read_map_h5(folder / "map.h5");
  ASSERT_TRUE(again.ok()) << error_line(again);
  EXPECT_EQ(again->points.size(), map.points.size());
  EXPECT_EQ(again->points[10].kind, ContourKind::crease);
  int markings = 0;
  for (const auto& p : again->points) markings += p.kind == ContourKind::marking ? 1 : 0;
  EXPECT_EQ(markings, 4);
}

TEST(MapH5, AFlippedByteIsFoundAndNamed) {
  const TemporaryFolder folder;
  ASSERT_TRUE(write_map_h5(folder / "map.h5", small_map()).ok());
  const std::string whole = content_of(folder / "map.h5");
  int named = 0, refused = 0;
  // Across the file; some bytes are padding.
  for (std::size_t at = 64; at < whole.size(); at += 37) {
    std::string spoilt = whole;
    spoilt[at] = static_cast<char>(spoilt[at] ^ 0x10);
    const std::string path = folder.file("spoilt.h5", spoilt);
    const auto map = read_map_h5(path);
    expect_no_harm(map, path, at);
    refused += map.ok() ? 0 : 1;
    named += !map.ok() && map.error().line().find(": /") != std::string::npos ? 1 : 0;
    if (map.ok()) expect_same(small_map(), *map);
  }
  EXPECT_GT(named, 0);
  EXPECT_GT(refused, 10);
}

TEST(MapH5, TruncationAnywhereIsAnswered) {
  const TemporaryFolder folder;
  const std::string path = folder / "map.h5";
  ASSERT_TRUE(write_map_h5(path, small_map()).ok());
  for (std::size_t n = std::filesystem::file_size(path); n-- > 0;) {
    std::filesystem::resize_file(path, n);
    const auto map = read_map_h5(path);
    ASSERT_FALSE(map.ok()) << n;
    ASSERT_TRUE(says(error_line(map), {"map.h5"})) << n;
  }
}

TEST(MapH5, OtherFilesAndVersionsAreRefused) {
  const TemporaryFolder folder;
  const auto write = [&](std::uint32_t major, const std::string& units,
                         const std::vector<std::string>& features) {
    auto temporary = TemporaryFile::create(folder / "map.h5");
    auto file = Hdf5File::create(*temporary);
    EXPECT_TRUE(file->make_group("/meta").ok());
    EXPECT_TRUE(file->set_attribute("/meta", "format", std::string("evpose-map")).ok());
    EXPECT_TRUE(file->set_attribute("/meta", "version_major", NumberType::u32, {}, &major).ok());
    EXPECT_TRUE(file->set_attribute("/meta", "units", units).ok());
    EXPECT_TRUE(file->set_attribute("/meta", "required_features", features).ok());
    EXPECT_TRUE(file->close().ok());
    EXPECT_TRUE(temporary->commit().ok());
    return error_line(read_map_h5(folder / "map.h5"));
  };
  EXPECT_TRUE(says(write(2, "m", {}), {"version_major is 2"}));
  EXPECT_TRUE(says(write(1, "ft", {}), {"units are 'ft'"}));
  EXPECT_TRUE(says(write(1, "m", {"splines"}), {"'splines'"}));
  EXPECT_TRUE(says(write(1, "m", {}), {"anchor"}));
  const std::string events = shared_folder() + "/data/real/mvsec_indoor_flying1_chunk/events.h5";
  EVPOSE_NEEDS_SHARED(events);
  EXPECT_TRUE(says(error_line(read_contour_map(events)), {"not a map file"}));
}

}  // namespace
}  // namespace evpose
