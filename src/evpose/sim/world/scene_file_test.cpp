// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/world/scene_file.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>

#include "evpose/core/parallel.h"
#include "evpose/io/files/test_files.h"
#include "evpose/sim/world/mesh_file.h"

namespace evpose::sim {
namespace {

const char* const kSmall = R"(
free_space: {low: [-1, -1, 0.5], high: [1, 1, 2]}
sky_cd_m2: 100
materials:
  - {name: grey, reflectance: 0.3}
  - {name: wood, pattern: planks, size_m: [1, 1], texel_m: 0.02}
lights:
  - {name: all around, kind: ambient, lux: 500}
objects:
  - {name: floor, quad: {corner: [-5, -5, 0], u: [10, 0, 0], v: [0, 10, 0]}, material: wood}
  - {name: crate, at: [2, 0, 0], yaw_deg: 90, box: {size: [1, 2, 3]}, material: grey}
)";

Expected<Scene> read(const TemporaryFolder& folder, const std::string& text) {
  ThreadPool pool(1);
  return read_scene(folder.file("scene.yaml", text), {}, pool);
}

// The same with one piece replaced by another.
std::string changed(const std::string& from, const std::string& to) {
  std::string text = kSmall;
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return at == std::string::npos ? text : text.replace(at, from.size(), to);
}

TEST(SceneFile, BodiesStandWhereTheyAreSaidTo) {
  const TemporaryFolder folder;
  const auto scene = read(folder, kSmall);
  ASSERT_TRUE(scene.ok()) << error_line(scene);
  EXPECT_EQ(scene->objects, (std::vector<std::string>{"floor", "crate"}));
  EXPECT_EQ(scene->high, Eigen::Vector3d(1, 1, 2));
  ASSERT_EQ(scene->mesh.triangles.size(), 14u);
  Eigen::AlignedBox3f crate;
  for (std::size_t i = 0; i < scene->mesh.triangles.size(); ++i)
    if (scene->mesh.object[i] == 1)
      for (const auto corner : scene->mesh.triangles[i]) crate.extend(scene->mesh.vertices[corner]);
  EXPECT_LT((crate.min() - Eigen::Vector3f(1, -0.5, 0)).norm(), 1e-5F);
  EXPECT_LT((crate.max() - Eigen::Vector3f(3, 0.5, 3)).norm(), 1e-5F);
  EXPECT_NE(scene->materials[1].texture, nullptr);
}

TEST(SceneFile, OwnThingsMoveAlongTheirPath) {
  const TemporaryFolder folder;
  const auto scene = read(folder, std::string(kSmall) + R"(
moving:
  - {name: cart, at: [0, 0, 0.1], box: {size: [1, 1, 1]}, material: grey, speed_m_s: 2,
     path: [[3, 0, 0], [0, 3, 0], [-3, 0, 0], [0, -3, 0]]}
  - {kind: fan, name: fan, at: [0, 0, 2], rpm: 60}
  - {kind: person, path: [[3, 0, 0], [0, 3, 0], [-3, 0, 0]]}
  - {kind: car, name: taxi, path: [[30, 0, 0], [0, 30, 0], [-30, 0, 0]]}
)");
  ASSERT_TRUE(scene.ok()) << error_line(scene);
  const auto& cart = scene->moving[0];
  EXPECT_EQ(cart.name, "cart");
  EXPECT_LT((cart.T_map_part(0).p - Eigen::Vector3d(3, 0, 0.1)).norm(), 1e-9);
  EXPECT_NEAR((cart.T_map_part(0.01).p - cart.T_map_part(0).p).norm(), 0.02, 1e-5);
  for (const char* name : {"cart", "fan", "person", "taxi"})
    EXPECT_NE(std::find(scene->objects.begin(), scene->objects.end(), name), scene->objects.end()) << name;
}

TEST(SceneFile, PrintedThingsAndFurnitureAreRead) {
  const TemporaryFolder folder;
  const std::string things = std::string(kSmall) + R"(
  - {name: pad, at: [0, 3, 0], landing_pad: {size_m: 2, height_m: 0, mark: squares, ink: grey}, material: wood}
  - {name: board, at: [0, -3, 0], checkerboard: {columns: 8, rows: 6, square_m: 0.1, ink: grey}, material: wood}
  - {name: stool, furniture: true, at: [0, 1, 0], box: {size: [0.4, 0.4, 0.5]}, material: wood}
)";
  const auto scene = read(folder, things);
  ASSERT_TRUE(scene.ok()) << error_line(scene);
  EXPECT_EQ(scene->furniture, std::vector<std::int32_t>{4});
  EXPECT_EQ(std::count(scene->mesh.object.begin(), scene->mesh.object.end(), 2), 2 * 81);
  const auto line = [&](const std::string& from, const std::string& to) {
    std::string text = things;
    return error_line(read(folder, text.replace(text.find(from), from.size(), to)));
  };
  EXPECT_EQ(line("mark: squares", "mark: cross"),
            folder / "scene.yaml" + ":13: mark: 'cross' is unknown; take none, h, ring or squares");
  EXPECT_EQ(line(", ink: grey", ""), folder / "scene.yaml" + ":13: landing_pad: 'ink' is missing; add it");
  EXPECT_EQ(line("square_m: 0.1", "square_m: 1"),
            folder / "scene.yaml" + ":14: middle_m: the board reaches below its foot; raise it");
}

TEST(SceneFile, AddsToABuiltInWorld) {
  const TemporaryFolder folder;
  const auto scene = read(folder, R"(
base: {kind: hall, seed: 3, texture_contrast: 0.5, movers: {fans: 1}}
materials: [{name: grey, reflectance: 0.3}]
objects: [{name: extra, at: [3, 3, 0], box: {size: [0.1, 0.1, 0.1]}, material: grey}]
)");
  ASSERT_TRUE(scene.ok()) << error_line(scene);
  EXPECT_EQ(scene->objects.back(), "extra");
  EXPECT_EQ(scene->moving.size(), 1u);
  EXPECT_GT(scene->mesh.triangles.size(), 1000u);
}

TEST(SceneFile, ReadsMeshesInBothFormats) {
  const TemporaryFolder folder;
  // A pyramid of 2 x 2 x 1 with its point up, in centimetres with y up; the base as one quad.
  folder.file("a.obj",
              "v -100 0 -100\nv 100 0 -100\nv 100 0 100\nv -100 0 100\nv 0 100 0\n"
              "f 1 2 3 4\nf 2 1 5\nf 3 2 5\nf 4 3 5\nf 1 4 5\n");
  folder.file(
      "b.ply",
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
      "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
  const auto scene =
      read(folder,
           std::string(kSmall) +
               "  - {name: pyramid, at: [0, 0, 5], mesh: {file: a.obj, scale: 0.01, up: y}, material: grey}\n"
               "  - {name: piece, mesh: {file: b.ply}, material: wood}\n");
  ASSERT_TRUE(scene.ok()) << error_line(scene);
  EXPECT_EQ(scene->mesh.triangles.size(), 14u + 6 + 1);
  Eigen::AlignedBox3f pyramid;
  for (std::size_t i = 14; i < 20; ++i)
    for (const auto corner : scene->mesh.triangles[i]) pyramid.extend(scene->mesh.vertices[corner]);
  EXPECT_LT((pyramid.min() - Eigen::Vector3f(-1, -1, 5)).norm(), 1e-5F);
  EXPECT_LT((pyramid.max() - Eigen::Vector3f(1, 1, 6)).norm(), 1e-5F);
}

TEST(SceneFile, PanesAreReadAndAreNoPartOfTheMesh) {
  const TemporaryFolder folder;
  const auto with = [&](const std::string& v) {
    return read(folder,
                std::string(kSmall) + "panes:\n  - {corner: [1, 2, 0], u: [3, 0, 0], v: " + v + "}\n");
  };
  const auto scene = with("[0, 0, 2]");
  ASSERT_TRUE(scene.ok()) << error_line(scene);
  EXPECT_EQ(scene->mesh.triangles.size(), 14u);
  ASSERT_EQ(scene->panes.size(), 1u);
  EXPECT_EQ(scene->panes[0].corner, Eigen::Vector3d(1, 2, 0));
  EXPECT_EQ(scene->panes[0].v, Eigen::Vector3d(0, 0, 2));
  const std::string told =
      ":13: pane: u and v are not the sides of a rectangle; give two directions at right angles";
  for (const char* v : {"[0, 0, 0]", "[1, 0, 2]", "[0, 0, 1e-9]"})
    EXPECT_EQ(error_line(with(v)), folder / "scene.yaml" + told) << v;
}

TEST(SceneFile, ThePublishedExampleIsRead) {
  ThreadPool pool(2);
  const auto scene = read_scene(std::string(EVPOSE_SOURCE_DIR) + "/scenarios/scenes/workshop.yaml", {}, pool);
  ASSERT_TRUE(scene.ok()) << error_line(scene);
  EXPECT_EQ(scene->name, "workshop");
}

TEST(SceneFile, FaultsAreToldInOneLine) {
  const TemporaryFolder folder;
  const auto says = [&](const std::string& from, const std::string& to, const std::string& line) {
    EXPECT_EQ(error_line(read(folder, changed(from, to))), folder / "scene.yaml" + line);
  };
  says("grey, reflectance: 0.3", "grey, reflectance: 3",
       ":5: reflectance: 3 is not between 0 and 1; correct it");
  says("reflectance", "reflectence", ":5: material: 'reflectence' is unknown; did you mean 'reflectance'?");
  says("pattern: planks", "pattern: blanks", ":6: pattern: 'blanks' is unknown; did you mean 'planks'?");
  says("material: grey", "material: gray", ":11: material: 'gray' is unknown; did you mean 'grey'?");
  says("material: grey", "colour: grey", ":11: object: 'material' is missing; add it");
  says("box: {size: [1, 2, 3]}", "box: {size: [1, 2]}",
       ":11: size: 2 numbers instead of 3; correct the list");
  says("[1, 2, 3]", "[1, 2, -3]", ":11: size: each must be between 0.001 and 1000 m; correct it");
  says("box: {size: [1, 2, 3]}", "ball: 3",
       ":11: object: none of box, cylinder, quad, mesh, landing_pad, checkerboard is there; add one");
  says("v: [0, 10, 0]", "v: [1, 0, 0]", ":10: quad: u and v span no area; give two directions");
  says("lux: 500", "lux: nan", ":8: lux: 'nan' is not a finite number; give a number");
  says("kind: ambient", "kind: neon", ":8: kind: 'neon' is no kind of light; take lamp, sun or ambient");
  says("high: [1, 1, 2]", "high: [1, -1, 2]", ":2: free_space: low is not below high; exchange them");
  says("sky_cd_m2", "sky_cd", ":3: scene: 'sky_cd' is unknown; did you mean 'sky_cd_m2'?");
  says("texel_m: 0.02", "texel_m: 0.02, size_m: [1, 1]", ":6: 'size_m' stands here twice; remove one");
  says("[1, 1], texel_m: 0.02", "[50, 50], texel_m: 0.001",
       ":6: texel_m: the texture would have more than 50 million texels; make it coarser or smaller");
  says("name: wood, pattern", "name: grey, pattern", ":6: material: 'grey' stands here twice; rename one");
  EXPECT_EQ(error_line(read(folder, "base: {kind: hal}")).substr(0, (folder / "scene.yaml").size() + 4),
            folder / "scene.yaml" + ":1: ");
  EXPECT_EQ(error_line(read(folder, "{}")),
            folder / "scene.yaml" +
                ":1: scene: 'free_space' is missing; give the box in which the camera may fly: free_space: "
                "{low: [x, y, z], high: [x, y, z]}");
}

TEST(SceneFile, BadMeshesAreToldInOneLine) {
  const TemporaryFolder folder;
  const auto line = [&](const std::string& name, const std::string& content) {
    return error_line(read_mesh(folder.file(name, content), {}));
  };
  EXPECT_EQ(line("a.stl", "solid"),
            folder / "a.stl: is neither .obj nor .ply; convert the mesh to one of them");
  for (const char* content :
       {"", "v 0 0 0\n", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "f f f\n",
        "v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "\x01\x02\x03"}) {
    const std::string told = line("b.obj", content);
    EXPECT_EQ(told.find((folder / "b.obj") + ": "), 0u) << content << " gives " << told;
    EXPECT_EQ(told.find('\n'), std::string::npos);
  }
  EXPECT_EQ(line("c.ply", "ply\nformat ascii 1.0\nelement vertex 99999999\n").find(folder / "c.ply"), 0u);
}

}  // namespace
}  // namespace evpose::sim
