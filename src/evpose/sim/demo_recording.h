// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "evpose/camera/camera.h"
#include "evpose/core/error.h"

namespace evpose::sim {

struct DemoOptions {
  ImageSize size{480, 360};  ///< 32 to 4096 px each way; the field of view is the same for any
  double duration_s = 3;     ///< 0.01 to 10
  std::uint32_t seed = 1;    ///< of textures, motion and noise
  int threads = 2;           ///< the files are the same for any number
};

/// Makes a recording of a drone that flies a square spiral through a furnished room, about 10 s of work per
/// second and core, into `folder`, which is created: events.h5, imu.csv, groundtruth.tum (1000 Hz, exact),
/// camchain-imucam.yaml, imu.yaml, contours.ply (true contours, 10 mm apart), mesh.ply (the scene's faces)
/// and scenario.yaml. Brightness is ray cast and thresholded pixel by pixel; most events come from texture
/// that is not in the contours. `progress`, if any, is called with the share done, 0 to 1. Errors: options
/// out of their range, a folder that cannot be made or written.
Status make_demo_recording(const std::string& folder, const DemoOptions& options,
                           const std::function<void(double fraction)>& progress);

}  // namespace evpose::sim
