// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/calibrate/binned_image.h"

#include <gtest/gtest.h>

#include <cmath>

namespace evpose {
namespace {

CameraIntrinsics camera(const std::string& model, std::vector<double> distortion) {
  CameraIntrinsics out;
  out.size = {1281, 719};
  out.fx = 760, out.fy = 758, out.cx = 644.3, out.cy = 352.1;
  out.distortion_model = model;
  out.distortion = std::move(distortion);
  return out;
}

// Pixels are squares about their centres: a place keeps its distance to the image's corner at (-0.5, -0.5),
// in pixels so many times as wide.
TEST(BinnedImage, ShowsEachPointWhereItsPixelGoes) {
  for (const CameraIntrinsics& given :
       {camera("radtan", {-0.1, 0.02, 5e-4, -3e-4}), camera("equidistant", {0.01, -0.02, 0.003, 0.001})})
    for (const int binning : {1, 2, 3}) {
      const auto whole = make_camera(given), coarse = make_camera(binned(given, binning));
      ASSERT_TRUE(whole && coarse);
      for (const Eigen::Vector3d& x : {Eigen::Vector3d{0.3, -0.2, 1}, {-0.6, 0.3, 1.2}, {0, 0, 2}}) {
        const auto fine_px = (*whole)->project(x), coarse_px = (*coarse)->project(x);
        ASSERT_TRUE(fine_px && coarse_px);
        const Eigen::Vector2d half = Eigen::Vector2d::Constant(0.5);
        EXPECT_TRUE((binning * (*coarse_px + half)).isApprox(*fine_px + half, 1e-9));
      }
    }
}

// The event of a pixel lies in the binned pixel that the pixel's centre falls into, inside of the image.
TEST(BinnedImage, EventsFollowTheirPixels) {
  const CameraIntrinsics given = camera("radtan", {0, 0, 0, 0});
  const CameraIntrinsics half = binned(given, 2);
  std::vector<FilteredEvent> events;
  for (const auto& [x, y] : {std::pair<unsigned, unsigned>{0, 0}, {1, 2}, {1280, 718}, {37, 401}})
    events.push_back({7, static_cast<std::uint16_t>(x), static_cast<std::uint16_t>(y & 0x7FFF), 1});
  const std::vector<FilteredEvent> coarse = binned(events, 2);
  ASSERT_EQ(coarse.size(), events.size());
  for (std::size_t i = 0; i < events.size(); ++i) {
    EXPECT_EQ(coarse[i].x, std::lround((events[i].x + 0.5) / 2 - 0.5 - 1e-9));
    EXPECT_EQ(coarse[i].y, std::lround((events[i].y + 0.5) / 2 - 0.5 - 1e-9));
    EXPECT_TRUE(coarse[i].x < half.size.width && coarse[i].y < half.size.height);
    EXPECT_EQ(coarse[i].stamp_us, 7U);
    EXPECT_EQ(coarse[i].on, 1U);
  }
}

}  // namespace
}  // namespace evpose
