// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/relocalization/place_search.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "evpose/relocalization/test_room.h"

namespace evpose {
namespace {

using test_room::camera_on_body;

/// A wall across the room, between the eye and the far side.
void add_wall(double x, ContourMap& map) {
  auto& mesh = map.occluders;
  for (const double y : {0.0, 5.0})
    for (const double z : {0.0, 3.0}) mesh.vertices.push_back(Eigen::Vector3d(x, y, z).cast<float>());
  mesh.triangles.push_back({0, 1, 2});
  mesh.triangles.push_back({1, 3, 2});
}

std::vector<std::uint32_t> all_seen(const PlaceIndex& index, const PlaceIndex::Place& place) {
  std::vector<std::uint32_t> out;
  for (int k = 0; k < PlaceIndex::kDirections; ++k)
    for (const std::uint32_t i : index.seen_from(place, k)) out.push_back(i);
  return out;
}

TEST(PlaceIndexLaws, APlaceSeesBothSidesOfARoomAndNothingBehindAWall) {
  ContourMap map = test_room::map_of(test_room::room());
  const ContourIndex open(map);
  const VisibleSetConfig config;
  const Eigen::AlignedBox3d middle(Eigen::Vector3d(1.2, 2.2, 1.2), Eigen::Vector3d(1.6, 2.6, 1.6));
  const auto beyond = [](const PlaceIndex& index, double x) {
    int near = 0, far = 0;
    for (const PlaceIndex::Place& place : index.places())
      for (const std::uint32_t i : all_seen(index, place))
        ++(index.sample(i).position.x() > static_cast<float>(x) ? far : near);
    return std::pair(near, far);
  };
  const PlaceIndex without(open, config, middle);
  ASSERT_EQ(without.places().size(), 1U);
  EXPECT_GT(beyond(without, 3.1).first, 100);
  EXPECT_GT(beyond(without, 3.1).second, 100);
  add_wall(3, map);
  const ContourIndex divided(map);
  const PlaceIndex with(divided, config, middle);
  ASSERT_EQ(with.places().size(), 1U);
  EXPECT_EQ(beyond(with, 3.1).second, 0);
  EXPECT_GT(beyond(with, 3.1).first, 100);
}

TEST(PlaceIndexLaws, DirectionsAroundAnAxisHoldEveryRayWithinTheAngle) {
  const ContourMap map = test_room::map_of(test_room::room());
  const ContourIndex contours(map);
  const PlaceIndex index(contours, {},
                         Eigen::AlignedBox3d(Eigen::Vector3d(3, 2, 1), Eigen::Vector3d(3.2, 2.2, 1.2)));
  ASSERT_EQ(index.places().size(), 1U);
  const PlaceIndex::Place& place = index.places().front();
  for (const Eigen::Vector3d& axis : {Eigen::Vector3d(1, 0.2, -0.3), Eigen::Vector3d(-0.4, 0.5, 0.8)}) {
    const double angle = 0.6;
    std::size_t expected = 0, held = 0;
    const auto within = [&](std::uint32_t i) {
      const Eigen::Vector3d ray = index.anchor() + index.sample(i).position.cast<double>() - place.middle;
      return std::acos(ray.normalized().dot(axis.normalized())) < angle;
    };
    const auto all = all_seen(index, place);
    expected = static_cast<std::size_t>(std::count_if(all.begin(), all.end(), within));
    for (const int k : PlaceIndex::directions_around(axis.normalized(), angle)) {
      const auto seen = index.seen_from(place, k);
      held += static_cast<std::size_t>(std::count_if(seen.begin(), seen.end(), within));
    }
    EXPECT_EQ(held, expected);
    EXPECT_GT(expected, 20U);
  }
}

class PlaceSearch : public ::testing::Test {
 protected:
  PlaceSearch()
      : camera_(test_room::make_room_camera()),
        edges_(test_room::room()),
        map_(test_room::map_of(edges_)),
        contours_(map_),
        places_(contours_, {}, space_around(map_)) {}
  std::vector<PoseGuess> search(const Pose& truth, std::span<const AttitudeGuess> attitudes) const {
    const auto lines = test_room::seen_lines(edges_, *camera_, truth * camera_on_body(), 0.5, 3);
    return search_places(lines, *camera_, camera_on_body(), places_, space_around(map_), attitudes, 50);
  }

  std::shared_ptr<const Camera> camera_;
  std::vector<test_room::Segment> edges_;
  ContourMap map_;
  ContourIndex contours_;
  PlaceIndex places_;
};

TEST_F(PlaceSearch, TheTruePlaceIsTheBestAlthoughHalfOfTheEdgesAreNotSeen) {
  const Eigen::Quaterniond turned = so3::exp({0, 0, M_PI / 2});
  for (const Eigen::Vector3d& p : {Eigen::Vector3d(1.5, 3.6, 1.2), Eigen::Vector3d(3.3, 1.4, 1.9)}) {
    const Pose truth{so3::exp({0, 0, 0.3}) * so3::exp({0.05, 0.1, 0}), p};
    const std::vector<AttitudeGuess> attitudes{{turned * truth.q}, {truth.q}, {turned * turned * truth.q}};
    const std::vector<PoseGuess> found = search(truth, attitudes);
    ASSERT_FALSE(found.empty());
    EXPECT_LT((found.front().T_map_body.p - p).norm(), 0.2) << found.front().T_map_body.p.transpose();
    EXPECT_LT(found.front().T_map_body.q.angularDistance(truth.q), 1e-6);
    EXPECT_GT(found.front().score, 4);  // standard deviations of chance
  }
}

TEST_F(PlaceSearch, OnlyPlacesOfTheBoxAreSearched) {
  const Pose truth{so3::exp({0, 0, 0.3}), {1.5, 3.6, 1.2}};
  const Eigen::AlignedBox3d box(Eigen::Vector3d(3.5, 0.5, 0.5), Eigen::Vector3d(5.5, 2.5, 2.5));
  const auto lines = test_room::seen_lines(edges_, *camera_, truth * camera_on_body(), 0.5, 3);
  const std::vector<AttitudeGuess> attitudes{{truth.q}};
  const double beside = places_.edge_m();
  for (const PoseGuess& g : search_places(lines, *camera_, camera_on_body(), places_, box, attitudes, 50))
    EXPECT_LE(box.exteriorDistance(g.T_map_body * camera_on_body().p), beside);
}

/// The score is that of the line's law: most on it, less beside it, nothing in another direction.
TEST(LineScoresLaws, FallWithTheDistanceAndWantTheDirection) {
  const auto camera = test_room::make_room_camera();
  const std::vector<EdgeLine> lines{{{60, 120}, {260, 120}}};
  const double spread = 0.02;
  const LineScores scores(lines, *camera, spread);
  const auto at = [&](double off, const Eigen::Vector3f& tangent) {
    SeenPoints points;
    points.add(Eigen::Vector3d(0, off, 1).cast<float>(), tangent);
    points.complete();
    return scores.sum(points, Eigen::Vector3f::Zero());
  };
  const Eigen::Vector3f along = Eigen::Vector3f::UnitX(), across = Eigen::Vector3f::UnitY();
  EXPECT_GT(at(0, along), 1);
  EXPECT_GT(at(0, along), at(spread, along) + 0.1F);
  EXPECT_GT(at(spread, along), at(3 * spread, along) + 0.1F);
  EXPECT_NEAR(at(6 * spread, along), std::log(0.7), 1e-3);
  EXPECT_NEAR(at(0, across), std::log(0.7), 1e-3);
  EXPECT_NEAR(at(5, along), -0.3, 1e-6);  // outside of the image
}

}  // namespace
}  // namespace evpose
