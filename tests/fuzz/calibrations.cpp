// SPDX-License-Identifier: BSD-3-Clause
// Calibrations of every kind; a camera that comes out of one is used.
#include <cmath>

#include "evpose/camera/placement.h"
#include "evpose/core/error.h"
#include "evpose/io/calibration/calibration.h"
#include "fuzz.h"

EVPOSE_FUZZ_TARGET(calibrations) {
  const auto file = evpose::read_calibration(evpose::fuzz::as_file(bytes));
  if (!file) return;
  for (std::size_t i = 0; i < file->cameras.size(); ++i) {
    const auto& T_cam_imu = file->cameras[i].T_cam_imu;
    if (T_cam_imu) {
      EVPOSE_CHECK(std::abs(T_cam_imu->q.norm() - 1) < 1e-9);
      (void)evpose::placement_in_words(T_cam_imu->inverse());
    }
    const auto camera = evpose::choose_camera(*file, static_cast<int>(i));
    if (!camera) continue;
    const auto lens = evpose::make_camera(*camera->intrinsics);
    EVPOSE_CHECK(lens.ok());
    const auto ray = (*lens)->unproject({3, 4});
    if (ray) EVPOSE_CHECK(ray->allFinite());
  }
}
