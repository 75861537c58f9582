// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/core/geodesy.h"

#include <gtest/gtest.h>

#include <cmath>

namespace evpose {
namespace {

constexpr double kPolarRadius_m = 6356752.314245;

TEST(Geodesy, AxesOfTheEllipsoid) {
  EXPECT_LT((ecef_from_llh({0, 0, 10}) - Eigen::Vector3d(6378147, 0, 0)).norm(), 1e-6);
  EXPECT_LT((ecef_from_llh({0, 90, -5}) - Eigen::Vector3d(0, 6378132, 0)).norm(), 1e-6);
  EXPECT_LT((ecef_from_llh({90, 33, 0}) - Eigen::Vector3d(0, 0, kPolarRadius_m)).norm(), 1e-5);
}

TEST(Geodesy, EveryPlaceOfNoHeightIsOnTheEllipsoid) {
  for (double latitude = -80; latitude < 90; latitude += 20)
    for (double longitude = -170; longitude < 180; longitude += 50) {
      const Eigen::Vector3d p = ecef_from_llh({latitude, longitude, 0});
      EXPECT_NEAR(p.head<2>().squaredNorm() / std::pow(6378137.0, 2) + std::pow(p.z() / kPolarRadius_m, 2), 1,
                  1e-12);
    }
}

TEST(Geodesy, HeightIsAlongTheNormal) {
  const Eigen::Vector3d origin(47.4, 8.5, 400);
  EXPECT_LT((ned_from_llh({47.4, 8.5, 412}, origin) - Eigen::Vector3d(0, 0, -12)).norm(), 1e-6);
}

TEST(Geodesy, SmallStepsHaveTheEllipsoidsRadiiOfCurvature) {
  for (const double latitude : {-60.0, 0.0, 47.4}) {
    const Eigen::Vector3d origin(latitude, 8.5, 0);
    constexpr double kStep_deg = 1e-4, kStep_rad = kStep_deg * M_PI / 180;
    const double e2 = 1 - std::pow(kPolarRadius_m / 6378137, 2), sine = std::sin(latitude * M_PI / 180);
    const double across = 6378137 / std::sqrt(1 - e2 * sine * sine);
    const double along = across * (1 - e2) / (1 - e2 * sine * sine);
    const Eigen::Vector3d north = ned_from_llh({latitude + kStep_deg, 8.5, 0}, origin);
    const Eigen::Vector3d east = ned_from_llh({latitude, 8.5 + kStep_deg, 0}, origin);
    EXPECT_NEAR(north.x(), along * kStep_rad, 1e-4);
    EXPECT_NEAR(east.y(), across * std::cos(latitude * M_PI / 180) * kStep_rad, 1e-4);
    EXPECT_LT(std::abs(north.y()) + std::abs(east.x()), 1e-3);
  }
}

TEST(Geodesy, EastNorthUpIsARotation) {
  EXPECT_TRUE((rotation_ned_enu() * rotation_ned_enu().transpose()).isIdentity(1e-15));
  EXPECT_NEAR(rotation_ned_enu().determinant(), 1, 1e-15);
  EXPECT_EQ(rotation_ned_enu() * Eigen::Vector3d(1, 2, 3), Eigen::Vector3d(2, 1, -3));
}

}  // namespace
}  // namespace evpose
