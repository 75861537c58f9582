// SPDX-License-Identifier: BSD-3-Clause
#include <functional>
#include <numbers>

#include "evpose/sim/patterns.h"
#include "evpose/sim/random.h"
#include "evpose/sim/scene.h"

namespace evpose::sim {
namespace {

// Finer than a pixel of the demo's camera at the room's usual distances.
constexpr double kTexel = 0.004;

class RoomBuilder {
 public:
  explicit RoomBuilder(std::uint64_t seed) : random_(seed, 0) {}

  // A face's covering, made for its size.
  using Cover = std::function<Pattern(BoxSide side, double width_m, double height_m, std::uint64_t seed)>;

  void add(const Eigen::Vector3d& middle, const Eigen::Vector3d& size, double yaw_deg, const Cover& cover) {
    Box box;
    box.half = 0.5 * size;
    box.T_map_box = {so3::exp(yaw_deg * std::numbers::pi / 180 * Eigen::Vector3d::UnitZ()), middle};
    for (BoxSide side = 0; side < 6; ++side) {
      const double width = size[texture_u_axis(side)], height = size[texture_v_axis(side)];
      // Each face has a tone of its own, so that a crease is an edge in the picture even where the light is
      // even.
      const double tone = 1 + 0.18 * (random_.uniform() - 0.5);
      const Pattern pattern = cover(side, width, height, random_.bits());
      box.faces.emplace_back(width, height, kTexel, [&](double u, double v) { return tone * pattern(u, v); });
    }
    scene_.boxes.push_back(std::move(box));
  }
  // By its lower side's middle.
  void stand(const Eigen::Vector3d& foot, const Eigen::Vector3d& size, double yaw_deg, const Cover& cover) {
    add(foot + Eigen::Vector3d(0, 0, 0.5 * size.z()), size, yaw_deg, cover);
  }
  Scene& scene() { return scene_; }

 private:
  Scene scene_;
  Random random_;
};

using Cover = RoomBuilder::Cover;

Cover covered_in_cartons(double mean) {
  return [=](BoxSide, double w, double h, std::uint64_t seed) { return carton(mean, w, h, seed); };
}
Cover covered_in_planks(double mean, double plank_m) {
  return [=](BoxSide, double, double, std::uint64_t seed) { return planks(mean, plank_m, seed); };
}
Cover covered_in_cloth(double mean) {
  return [=](BoxSide, double, double, std::uint64_t seed) { return cloth(mean, seed); };
}
Cover covered_in_tiles(double mean, double tile_m) {
  return [=](BoxSide, double, double, std::uint64_t seed) { return tiles(mean, tile_m, seed); };
}
Cover covered_in_bricks(double mean) {
  return [=](BoxSide, double, double, std::uint64_t seed) { return bricks(mean, seed); };
}

Pattern room_side(BoxSide side, double width_m, double height_m, std::uint64_t seed) {
  switch (side) {
    case 0:
      return posters(plaster(0.5, seed), width_m, height_m, seed + 1);
    case 1:
      return posters(bricks(0.32, seed), width_m, height_m, seed + 1);
    case 2:
      return posters(plaster(0.42, seed), width_m, height_m, seed + 1);
    case 3:
      return posters(planks(0.38, 0.14, seed), width_m, height_m, seed + 1);
    case 4:
      return tiles(0.3, 0.3, seed);
    default:
      return plaster(0.68, seed);
  }
}

void add_table(RoomBuilder& room) {
  const Eigen::Vector3d middle(3.7, 3.25, 0);
  const double yaw_deg = 17;
  const Eigen::Quaterniond turn = so3::exp(yaw_deg * std::numbers::pi / 180 * Eigen::Vector3d::UnitZ());
  for (const double x : {-0.6, 0.6}) {
    for (const double y : {-0.32, 0.32}) {
      room.stand(middle + turn * Eigen::Vector3d(x, y, 0), {0.07, 0.07, 0.7}, yaw_deg,
                 covered_in_planks(0.1, 0.03));
    }
  }
  room.stand(middle + Eigen::Vector3d(0, 0, 0.7), {1.4, 0.8, 0.05}, yaw_deg, covered_in_planks(0.7, 0.11));
  room.stand(middle + Eigen::Vector3d(0.3, 0.05, 0.75), {0.36, 0.28, 0.22}, 41, covered_in_cartons(0.16));
  room.stand(middle + Eigen::Vector3d(-0.35, -0.1, 0.75), {0.3, 0.24, 0.3}, -8, covered_in_cloth(0.15));
}

void add_shelf(RoomBuilder& room) {
  constexpr double kX = 5.82, kDepth = 0.36, kLeft = 0.7, kRight = 2.1, kBoard = 0.04, kHeight = 2.0;
  const Cover wood = covered_in_planks(0.75, 0.09);
  for (const double y : {kLeft, kRight}) room.stand({kX, y, 0}, {kDepth, kBoard, kHeight}, 0, wood);
  const double inner = kRight - kLeft - kBoard, middle = 0.5 * (kLeft + kRight);
  for (const double z : {0.1, 0.58, 1.06, 1.54})
    room.stand({kX + 0.015, middle, z}, {kDepth - 0.03, inner, kBoard}, 0, wood);
  room.stand({kX + 0.015, middle - 0.4, 0.62}, {0.24, 0.34, 0.3}, 9, covered_in_cartons(0.5));
  room.stand({kX + 0.015, middle + 0.25, 0.62}, {0.22, 0.5, 0.24}, -5, covered_in_cloth(0.3));
  room.stand({kX + 0.015, middle - 0.2, 1.1}, {0.22, 0.4, 0.32}, -12, covered_in_cartons(0.36));
  room.stand({kX + 0.015, middle + 0.3, 1.58}, {0.24, 0.4, 0.26}, 10, covered_in_tiles(0.5, 0.06));
}

void add_crates(RoomBuilder& room) {
  room.stand({4.6, 1.15, 0}, {0.75, 0.6, 0.55}, 28, covered_in_cartons(0.72));
  room.stand({4.62, 1.18, 0.55}, {0.46, 0.36, 0.4}, 52, covered_in_cartons(0.13));
  room.stand({3.5, 0.75, 0}, {0.55, 0.5, 0.45}, -20, covered_in_planks(0.1, 0.1));
  room.stand({5.0, 4.2, 0}, {0.8, 0.7, 0.8}, 12, covered_in_planks(0.7, 0.12));
  room.stand({5.02, 4.18, 0.8}, {0.55, 0.45, 0.45}, -15, covered_in_cartons(0.13));
  room.stand({0.6, 1.2, 0}, {0.7, 0.8, 0.6}, -33, covered_in_cartons(0.4));
}

}  // namespace

Scene make_box_room(std::uint64_t seed) {
  RoomBuilder room(seed);
  room.add({3, 2.5, 1.5}, {6, 5, 3}, 0, room_side);
  add_table(room);
  add_shelf(room);
  add_crates(room);
  room.stand({4.35, 2.3, 0}, {0.32, 0.32, 3}, 0, covered_in_bricks(0.11));         // pillar
  room.stand({3.2, 4.72, 0}, {1.1, 0.56, 1.9}, 0, covered_in_planks(0.12, 0.18));  // cupboard at the wall
  room.stand({5.91, 3.05, 0.9}, {0.18, 0.9, 0.7}, 0, covered_in_cloth(0.45));      // box on the far wall
  room.stand({3.0, 2.5, 2.78}, {0.24, 5, 0.22}, 0, covered_in_planks(0.42, 0.2));  // beam under the ceiling
  room.stand({0.2, 3.6, 0}, {0.4, 1.5, 0.5}, 0, covered_in_cloth(0.35));           // bench at the near wall
  Scene scene = std::move(room.scene());
  scene.lamp = {2.2, 1.7, 2.4};
  scene.lamp_power = 3;
  scene.ambient = 0.45;
  return scene;
}

}  // namespace evpose::sim
