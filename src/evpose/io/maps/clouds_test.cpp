// SPDX-License-Identifier: BSD-3-Clause
// PLY, PCD, LAS and LZF.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

#include "evpose/io/files/child_process.h"
#include "evpose/io/files/test_files.h"
#include "evpose/io/maps/las.h"
#include "evpose/io/maps/pcd.h"
#include "evpose/io/maps/ply.h"

namespace evpose {
namespace {

template <class T>
std::string bytes_of(T value, bool big = false) {
  std::string out(sizeof value, '\0');
  std::memcpy(out.data(), &value, sizeof value);
  if (big) std::reverse(out.begin(), out.end());
  return out;
}

/// The same two vertices and one quadrangle in each encoding; with a list in an element between, and a list
/// property among the vertices' own.
std::string small_ply(const std::string& format, const std::string& newline = "\n") {
  std::string out;
  for (const char* line : {"ply", "", "comment by hand", "element vertex 2", "property float x",
                           "property double y", "property list uchar short tags", "property short z",
                           "property uchar kind", "element extra 1", "property list int double values",
                           "element face 1", "property list uchar int vertex_indices", "end_header"})
    out += (*line == '\0' ? "format " + format + " 1.0" : std::string(line)) + newline;
  if (format == "ascii") return out + "1.5 -2 2 7 8 3 1\n-4 5 0 6 2\n1 9.5\n4 0 1 1 0\n";
  const bool big = format == "binary_big_endian";
  out += bytes_of(1.5F, big) + bytes_of(-2.0, big) + "\2" + bytes_of<std::int16_t>(7, big) +
         bytes_of<std::int16_t>(8, big) + bytes_of<std::int16_t>(3, big) + "\1";
  out += bytes_of(-4.0F, big) + bytes_of(5.0, big) + std::string(1, '\0') + bytes_of<std::int16_t>(6, big) +
         "\2";
  out += bytes_of<std::int32_t>(1, big) + bytes_of(9.5, big) + "\4";
  for (const std::int32_t corner : {0, 1, 1, 0}) out += bytes_of(corner, big);
  return out;
}

TEST(Ply, EveryEncodingGivesTheSameTable) {
  const TemporaryFolder folder;
  for (const char* format : {"ascii", "binary_little_endian", "binary_big_endian"}) {
    for (const char* newline : {"\n", "\r\n"}) {
      const std::string path = folder.file("a.ply", small_ply(format, newline));
      const auto table = read_ply_vertices(path);
      ASSERT_TRUE(table.ok()) << format << error_line(table);
      EXPECT_EQ(table->names, (std::vector<std::string>{"x", "y", "z", "kind"}));
      EXPECT_EQ(*table->find("x"), (std::vector<double>{1.5, -4}));
      EXPECT_EQ(*table->find("y"), (std::vector<double>{-2, 5}));
      EXPECT_EQ(*table->find("z"), (std::vector<double>{3, 6}));
      EXPECT_EQ(*table->find("kind"), (std::vector<double>{1, 2}));
      const auto mesh = read_ply_mesh(path, {1, 0, 0});
      ASSERT_TRUE(mesh.ok()) << error_line(mesh);
      EXPECT_EQ(mesh->vertices[0], Eigen::Vector3f(0.5, -2, 3));
      ASSERT_EQ(mesh->triangles.size(), 2u);
      EXPECT_EQ(mesh->triangles[1], (std::array<std::uint32_t, 3>{0, 1, 0}));
      EXPECT_EQ(read_ply_points(path).value()[1], Eigen::Vector3d(-4, 5, 6));
    }
  }
}

TEST(Ply, TruncationAnywhereIsToldInBytesOrLines) {
  const TemporaryFolder folder;
  for (const char* format : {"ascii", "binary_little_endian", "binary_big_endian"}) {
    const std::string whole = small_ply(format);
    for (std::size_t n = 0; n + 1 < whole.size(); ++n) {
      const std::string path = folder.file("a.ply", whole.substr(0, n));
      const auto table = read_ply_vertices(path);
      // Text may lose the last digit of its last number and still be whole.
      const bool may_be_whole = std::string(format) == "ascii" && n + 2 >= whole.size();
      EXPECT_TRUE(may_be_whole || !table.ok()) << format << " " << n;
      expect_no_harm(table, path, n);
      expect_no_harm(read_ply_mesh(path, Eigen::Vector3d::Zero()), path, n);
    }
  }
}

TEST(Ply, ErrorsNameWhatAndWhere) {
  const TemporaryFolder folder;
  const auto points = [&](const std::string& content) {
    return error_line(read_ply_points(folder.file("a.ply", content)));
  };
  const std::string xyz = "property float x\nproperty float y\nproperty float z\n";
  const std::string binary =
      "ply\nformat binary_little_endian 1.0\nelement vertex 2\n" + xyz + "end_header\n";
  const std::string ascii = "ply\nformat ascii 1.0\nelement vertex 2\n" + xyz + "end_header\n";
  EXPECT_TRUE(says(points(""), {"a.ply", "0 bytes"}));
  EXPECT_TRUE(says(points("solid\n"), {"not a PLY file"}));
  EXPECT_TRUE(says(points("ply\nformat binary_middle_endian 1.0\n"), {"a.ply:2", "binary_middle_endian"}));
  EXPECT_TRUE(says(points("ply\nelement vertex -1\n"), {"a.ply:2", "'-1'"}));
  EXPECT_TRUE(says(points("ply\nelement vertex 1\nproperty quad x\n"), {"a.ply:3", "not understood"}));
  EXPECT_TRUE(says(points("ply\nelement vertex 0\nend_header\n"), {"a.ply:3", "no format"}));
  EXPECT_TRUE(says(points(binary + std::string(20, 'x')), {"24 bytes", "20", "truncated"}));
  EXPECT_TRUE(says(points(binary + std::string(30, 'x')), {"24 bytes", "30"}));
  EXPECT_TRUE(says(points(ascii + "1 2 3\n1 2 nan\n"), {"vertex 1 ", "not finite"}));
  EXPECT_TRUE(says(points(ascii + "1 2 3\n1 2 x\n"), {"a.ply:9", "not the numbers"}));
  EXPECT_TRUE(says(points(ascii + "1 2 3\n1 2 3 4\n"), {"a.ply:9", "not the numbers"}));
  EXPECT_TRUE(says(points(ascii + "1 2 3\n1 2 3\n4 5 6\n"), {"a.ply:10", "more lines"}));
  EXPECT_TRUE(says(points("ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n"),
                   {"x, y and z"}));
  // Counts that no memory could hold are refused by the size of the file.
  EXPECT_TRUE(says(
      points("ply\nformat binary_little_endian 1.0\nelement vertex 2000000000\n" + xyz + "end_header\nabc"),
      {"2.4e+10 bytes", "3"}));
  const std::string face =
      "ply\nformat ascii 1.0\nelement vertex 1\n" + xyz +
      "element face 1\nproperty list uchar int vertex_index\nend_header\n1 2 3\n3 0 0 1\n";
  EXPECT_TRUE(says(error_line(read_ply_mesh(folder.file("a.ply", face), Eigen::Vector3d::Zero())),
                   {"face 0 ", "vertex 1 of 1"}));
}

TEST(Las, APointOfManyBytesTakesNoMoreMemoryThanTheFileHas) {
  const TemporaryFolder folder;
  constexpr std::uint16_t kRowBytes = 65000;
  std::string file(227, '\0');
  const auto put = [&](std::size_t at, const std::string& bytes) { file.replace(at, bytes.size(), bytes); };
  put(0, "LASF");
  put(24, std::string("\1\2"));
  put(96, bytes_of<std::uint32_t>(227));
  put(105, bytes_of(kRowBytes));
  put(107, bytes_of<std::uint32_t>(1));
  for (std::size_t k = 0; k < 3; ++k) put(131 + 8 * k, bytes_of(0.5));
  file += bytes_of<std::int32_t>(2) + bytes_of<std::int32_t>(-4) + bytes_of<std::int32_t>(6);
  file.resize(227 + kRowBytes);
  const auto is_read = [](const std::string& path) {
    const auto table = read_las(path);
    return table.ok() && table->find("y") != nullptr && *table->find("y") == std::vector<double>{-2};
  };
  EXPECT_TRUE(child_survives(is_read, folder.file("a.las", file)));  // which has a gigabyte
}

TEST(Ply, WrittenPointsAndMeshesReadBack) {
  const TemporaryFolder folder;
  const std::vector<Eigen::Vector3d> points = {{1, 2, 3}, {-0.5, 0.25, 1e3}};
  ASSERT_TRUE(write_ply_points(folder / "a.ply", points).ok());
  EXPECT_EQ(read_ply_points(folder / "a.ply").value(), points);
  TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0.5}};
  mesh.triangles = {{0, 1, 2}, {2, 1, 0}};
  const Eigen::Vector3d anchor(100, -200, 3);
  ASSERT_TRUE(write_ply_mesh(folder / "b.ply", mesh, anchor).ok());
  const auto again = read_ply_mesh(folder / "b.ply", anchor);
  ASSERT_TRUE(again.ok()) << error_line(again);
  EXPECT_EQ(again->vertices, mesh.vertices);
  EXPECT_EQ(again->triangles, mesh.triangles);
}

TEST(Ply, RealCloudsHaveTheKnownCounts) {
  const std::string folder = shared_folder() + "/data/";
  EVPOSE_NEEDS_SHARED(folder);
  const std::pair<const char*, std::size_t> counts[] = {{"real/clouds/street_lidar_scan.ply", 64056},
                                                        {"real/clouds/office_rgbd.ply", 254456},
                                                        {"real/clouds/vector_sofa_semi_dense.ply", 65026},
                                                        {"real/clouds/hall_lidar_4cm.ply", 1211864}};
  for (const auto& [name, count] : counts) {
    const auto points = read_ply_points(folder + name);
    ASSERT_TRUE(points.ok()) << error_line(points);
    EXPECT_EQ(points->size(), count) << name;
  }
  const auto mesh = read_ply_mesh(folder + "peer/maps/room_mesh.ply", Eigen::Vector3d::Zero());
  ASSERT_TRUE(mesh.ok()) << error_line(mesh);
  EXPECT_EQ(mesh->vertices.size(), 18306u);
  EXPECT_EQ(mesh->triangles.size(), 9280u);
}

std::string pcd_header(const std::string& data, int points, const std::string& more = "") {
  return "# .PCD v.7\nVERSION .7\nFIELDS x y z label\nSIZE 4 4 8 1\nTYPE F F F U\nCOUNT 1 1 1 2\nWIDTH " +
         std::to_string(points) + "\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS " + std::to_string(points) +
         "\n" + more + "DATA " + data + "\n";
}

/// As the encoder leaves what does not repeat: runs of up to 32 plain bytes.
std::string lzf_plain(const std::string& s) {
  std::string out;
  for (std::size_t i = 0; i < s.size(); i += 32) {
    const std::string run = s.substr(i, 32);
    out += static_cast<char>(run.size() - 1) + run;
  }
  return out;
}

std::string small_pcd(const std::string& data) {
  if (data == "ascii") return pcd_header(data, 2) + "1 2 3 4 5\n-1 -2 -3 6 255\n";
  if (data == "binary")
    return pcd_header(data, 2) + bytes_of(1.0F) + bytes_of(2.0F) + bytes_of(3.0) + "\4\5" + bytes_of(-1.0F) +
           bytes_of(-2.0F) + bytes_of(-3.0) + "\6\xFF";
  const std::string fields = bytes_of(1.0F) + bytes_of(-1.0F) + bytes_of(2.0F) + bytes_of(-2.0F) +
                             bytes_of(3.0) + bytes_of(-3.0) + "\4\5\6\xFF";
  const std::string packed = lzf_plain(fields);
  return pcd_header(data, 2) + bytes_of(static_cast<std::uint32_t>(packed.size())) +
         bytes_of(static_cast<std::uint32_t>(fields.size())) + packed;
}

TEST(Pcd, EveryEncodingGivesTheSameTable) {
  const TemporaryFolder folder;
  for (const char* data : {"ascii", "binary", "binary_compressed"}) {
    const auto table = read_pcd(folder.file("a.pcd", small_pcd(data)));
    ASSERT_TRUE(table.ok()) << data << error_line(table);
    EXPECT_EQ(table->names, (std::vector<std::string>{"x", "y", "z", "label_0", "label_1"}));
    EXPECT_EQ(*table->find("x"), (std::vector<double>{1, -1}));
    EXPECT_EQ(*table->find("y"), (std::vector<double>{2, -2}));
    EXPECT_EQ(*table->find("z"), (std::vector<double>{3, -3}));
    EXPECT_EQ(*table->find("label_0"), (std::vector<double>{4, 6})) << data;
    EXPECT_EQ(*table->find("label_1"), (std::vector<double>{5, 255})) << data;
  }
}

TEST(Pcd, AViewpointIsHandedOnUnlessItIsTheOrigin) {
  const TemporaryFolder folder;
  const auto read = [&](const std::string& viewpoint) {
    return read_pcd(folder.file("a.pcd",
                                "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 1\n"
                                "HEIGHT 1\n" +
                                    viewpoint + "POINTS 1\nDATA ascii\n1 2 3\n"));
  };
  const auto told = read("VIEWPOINT 1.5 -2 0.25 1 0 0 0\n");
  ASSERT_TRUE(told.ok()) << error_line(told);
  EXPECT_EQ(told->viewpoint, (std::array<double, 3>{1.5, -2, 0.25}));
  for (const char* unknown :
       {"", "VIEWPOINT 0 0 0 1 0 0 0\n", "VIEWPOINT 1 nan 0 1 0 0 0\n", "VIEWPOINT 1\n"}) {
    const auto table = read(unknown);
    ASSERT_TRUE(table.ok()) << error_line(table);
    EXPECT_FALSE(table->viewpoint) << unknown;
  }
}

TEST(Pcd, TruncationAnywhereIsAnswered) {
  const TemporaryFolder folder;
  for (const char* data : {"ascii", "binary", "binary_compressed"}) {
    const std::string whole = small_pcd(data);
    for (std::size_t n = 0; n + 3 < whole.size(); ++n) {
      const std::string path = folder.file("a.pcd", whole.substr(0, n));
      const auto table = read_pcd(path);
      EXPECT_FALSE(table.ok()) << data << " " << n;
      expect_no_harm(table, path, n);
    }
  }
}

TEST(Pcd, AbsentPointsAreLeftOut) {
  const TemporaryFolder folder;
  const auto table =
      read_pcd(folder.file("a.pcd", pcd_header("ascii", 3) + "1 2 3 4 5\nnan nan nan 0 0\n7 8 9 1 2\n"));
  ASSERT_TRUE(table.ok()) << error_line(table);
  EXPECT_EQ(*table->find("x"), (std::vector<double>{1, 7}));
  EXPECT_EQ(*table->find("label_1"), (std::vector<double>{5, 2}));
}

TEST(Pcd, ErrorsNameWhatAndWhere) {
  const TemporaryFolder folder;
  const auto error = [&](const std::string& content) {
    return error_line(read_pcd(folder.file("a.pcd", content)));
  };
  EXPECT_TRUE(says(error(""), {"a.pcd", "0 bytes"}));
  EXPECT_TRUE(says(error("garbage line\n"), {"a.pcd:1", "garbage"}));
  EXPECT_TRUE(says(error("FIELDS x\nSIZE 4 4\n"), {"a.pcd:2", "SIZE"}));
  EXPECT_TRUE(says(error("FIELDS x\nSIZE 3\nTYPE F\nPOINTS 1\nDATA ascii\n"), {"'x'", "F3"}));
  EXPECT_TRUE(says(error(pcd_header("binary", 2) + "short"), {"36 bytes", "5", "truncated"}));
  EXPECT_TRUE(says(error(pcd_header("ascii", 2) + "1 2 3 4 5\n"), {"after 1 of 2 points"}));
  EXPECT_TRUE(says(error(pcd_header("ascii", 1) + "1 2 3 4\n"), {"a.pcd:12", "4 values instead of 5"}));
  EXPECT_TRUE(says(error(pcd_header("zip", 1)), {"a.pcd:11", "'zip'"}));
  EXPECT_TRUE(says(error(pcd_header("binary", 2'000'000'000)), {"3.6e+10 bytes", "0"}));
  std::string lying = small_pcd("binary_compressed");
  lying.replace(lying.find("DATA binary_compressed\n") + 23 + 4, 4, bytes_of<std::uint32_t>(0xFFFFFFFF));
  EXPECT_TRUE(says(error(lying), {"4294967295"}));
}

}  // namespace
}  // namespace evpose
