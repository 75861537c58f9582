// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/world/moved_furniture.h"

#include <Eigen/Geometry>
#include <numbers>
#include <set>
#include <utility>
#include <vector>

#include "evpose/sim/world/random.h"

namespace evpose::sim {
namespace {

using Box = Eigen::AlignedBox3d;

constexpr std::uint64_t kStream = 1ULL << 45;
constexpr double kLeast_m = 0.05, kMost_m = 0.5, kMostTurn_rad = std::numbers::pi / 18;
constexpr double kTouch_m = 0.01;  // bodies that overlap by less only touch
constexpr int kTrials = 60;

class Mover {
 public:
  Mover(const Scene& scene, std::uint64_t seed) : scene_(scene), random_(seed, kStream) {}

  /// Moves a piece, if it finds room.
  bool move(std::int32_t object) {
    const std::set<std::uint32_t> vertices = vertices_of(object);
    const Box before = box_of(vertices, Pose());
    for (int trial = 0; trial < kTrials; ++trial) {
      const double angle = random_.uniform(0, 2 * std::numbers::pi),
                   away = random_.uniform(kLeast_m, kMost_m);
      const Pose turn{so3::exp({0, 0, random_.uniform(-kMostTurn_rad, kMostTurn_rad)}), {}};
      const Eigen::Vector3d centre = before.center(),
                            shift(away * std::cos(angle), away * std::sin(angle), 0);
      const Pose T{turn.q, centre + shift - turn.q * centre};
      if (!is_free(object, before, box_of(vertices, T))) continue;
      apply(object, vertices, T);
      return true;
    }
    return false;
  }
  Scene take() { return std::move(scene_); }

 private:
  std::set<std::uint32_t> vertices_of(std::int32_t object) const {
    std::set<std::uint32_t> vertices;
    const Mesh& mesh = scene_.mesh;
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i)
      if (mesh.object[i] == object) vertices.insert(mesh.triangles[i].begin(), mesh.triangles[i].end());
    return vertices;
  }
  Box box_of(const std::set<std::uint32_t>& vertices, const Pose& T) const {
    Box box;
    for (const std::uint32_t v : vertices) box.extend(T * scene_.mesh.vertices[v].cast<double>());
    return box;
  }
  // Nothing of another object within or on the way, unless it was before (a chair at a table).
  bool is_free(std::int32_t object, const Box& before, const Box& after) const {
    const Eigen::Vector3d skin = Eigen::Vector3d::Constant(kTouch_m);
    const Box swept = before.merged(after), inner(swept.min() + skin, swept.max() - skin),
              old(before.min() + skin, before.max() - skin);
    const Mesh& mesh = scene_.mesh;
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
      if (mesh.object[i] == object) continue;
      Box triangle;
      for (const std::uint32_t v : mesh.triangles[i]) triangle.extend(mesh.vertices[v].cast<double>());
      if (inner.intersects(triangle) && !old.intersects(triangle)) return false;
    }
    return true;
  }
  void apply(std::int32_t object, const std::set<std::uint32_t>& vertices, const Pose& T) {
    Mesh& mesh = scene_.mesh;
    for (const std::uint32_t v : vertices)
      mesh.vertices[v] = (T * mesh.vertices[v].cast<double>()).cast<float>();
    const Eigen::Quaternionf turn = T.q.cast<float>();
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i)
      if (mesh.object[i] == object)
        for (Eigen::Vector3f& normal : mesh.normals[i]) normal = turn * normal;
  }

  Scene scene_;
  Random random_;
};

}  // namespace

Expected<Scene> with_moved_furniture(const Scene& scene, int count, std::uint64_t seed) {
  std::vector<std::int32_t> pieces = scene.furniture;
  Random random(seed, kStream + 1);
  for (std::size_t i = pieces.size(); i > 1; --i)
    std::swap(pieces[i - 1], pieces[static_cast<std::size_t>(random.uniform() * static_cast<double>(i))]);
  Mover mover(scene, seed);
  int moved = 0;
  for (const std::int32_t piece : pieces) {
    if (moved == count) break;
    moved += mover.move(piece);
  }
  if (moved < count)
    return Error{"lidar.moved_furniture",
                 text(count, " pieces cannot be moved, of ", pieces.size(), " only ", moved, " have room"),
                 "take fewer, or mark objects of the scene as furniture"};
  return mover.take();
}

}  // namespace evpose::sim
