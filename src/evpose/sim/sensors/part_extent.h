// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/core/time.h"
#include "evpose/sim/flight/motion.h"
#include "evpose/sim/world/scene.h"

namespace evpose::sim {

/// Surfaces nearer than this do not raise the bound of the optical flow any further.
inline constexpr double kNearest_m = 0.02;

/// Pixels [x0, x1) x [y0, y1).
struct PixelBox {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;
};

/// Bounding box of a moving part in the image, and its fastest optical flow.
struct PartExtent {
  bool visible = false;
  double speed_px_s = 0;
  PixelBox box;
};

/// Extent of a part from `t` to `ahead_s` later, from the corners of the box around its mesh.
PartExtent part_extent(const MovingPart& part, const Camera& camera, const CameraPath& path, TimeNs t,
                       double ahead_s);

/// Extent of each moving part from t0 to t1.
std::vector<PartExtent> part_extents(const Scene& scene, const Camera& camera, const CameraPath& path,
                                     TimeNs t0, TimeNs t1);

}  // namespace evpose::sim
