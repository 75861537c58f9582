// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/relocalization/attitude_finder.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "evpose/relocalization/test_room.h"

namespace evpose {
namespace {

using test_room::camera_on_body;

/// Events along the lines that a camera sees of a room, a quarter of its pixels at random beside them.
class AttitudeFinderLaws : public ::testing::Test {
 protected:
  std::vector<FilteredEvent> events(const Pose& T_map_body) const {
    std::vector<FilteredEvent> out;
    const auto add = [&out](double x, double y) {
      FilteredEvent e{};
      e.x = static_cast<std::uint16_t>(std::clamp<long>(std::lround(x), 0, 319));
      e.y = static_cast<std::uint16_t>(std::clamp<long>(std::lround(y), 0, 239) & 0x7FFF);
      e.on = true;
      out.push_back(e);
    };
    std::mt19937 random(3);
    for (const EdgeLine& line :
         test_room::seen_lines(edges_, *camera_, T_map_body * camera_on_body(), 0.6, 7)) {
      const double length = (line.to - line.from).norm();
      for (double s = 0; s <= length; ++s) {
        const Eigen::Vector2d at = line.from + s / length * (line.to - line.from);
        add(at.x(), at.y());
        if (random() % 4 == 0) add(static_cast<double>(random() % 320), static_cast<double>(random() % 240));
      }
    }
    return out;
  }

  std::shared_ptr<const Camera> camera_ = test_room::make_room_camera();
  std::vector<test_room::Segment> edges_ = test_room::room();
  ContourMap map_ = test_room::map_of(edges_);
  AttitudeFinder finder_{map_, *camera_};
};

TEST_F(AttitudeFinderLaws, AnAttitudeThatIsKnownToFiveDegreesIsFoundToItsSigma) {
  const double sigma = 0.05;
  for (const double heading : {0.3, 1.5, -2.2}) {
    const Eigen::Quaterniond truth = so3::exp({0, 0, heading}) * so3::exp({0.08, -0.06, 0});
    const auto seen = events({truth, {3, 2.5, 1.4}});
    for (const Eigen::Vector3d& off : {Eigen::Vector3d(0.05, -0.05, 0.05), Eigen::Vector3d(-0.07, 0, 0.04)}) {
      const auto found = finder_.find(seen, camera_on_body().q, truth * so3::exp(off),
                                      sigma * sigma * Eigen::Matrix3d::Identity());
      ASSERT_FALSE(found.empty());
      ASSERT_LE(found.size(), 3U);
      double nearest = 4;
      for (const auto& q : found) nearest = std::min(nearest, q.angularDistance(truth));
      EXPECT_LT(nearest, 2 * AttitudeFinder::kSigma_rad) << heading << ' ' << off.transpose();
    }
  }
}

TEST_F(AttitudeFinderLaws, NoneLiesFarOutsideOfThePrior) {
  const Eigen::Quaterniond truth = so3::exp({0.08, -0.06, 0});
  const double sigma = 0.02;
  const Eigen::Quaterniond wrong = so3::exp({0, 0, 0.3}) * truth;
  for (const auto& q : finder_.find(events({truth, {3, 2.5, 1.4}}), camera_on_body().q, wrong,
                                    sigma * sigma * Eigen::Matrix3d::Identity()))
    EXPECT_LT(q.angularDistance(wrong), 2.5 * std::sqrt(3.0) * sigma + 1e-9);
}

TEST_F(AttitudeFinderLaws, WithoutEventsThereIsNone) {
  EXPECT_TRUE(
      finder_.find({}, camera_on_body().q, Eigen::Quaterniond::Identity(), Eigen::Matrix3d::Identity())
          .empty());
}

TEST(AttitudeFinder, SuitsPriorsThatAreKnownWorseThanWhatItFinds) {
  const auto known_to = [](double sigma) {
    return Eigen::Matrix3d(sigma * sigma * Eigen::Matrix3d::Identity());
  };
  EXPECT_FALSE(AttitudeFinder::suits(known_to(0.005)));
  EXPECT_TRUE(AttitudeFinder::suits(known_to(0.05)));
}

}  // namespace
}  // namespace evpose
