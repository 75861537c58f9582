// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/core/time.h"
#include "evpose/sim/flight/motion.h"
#include "evpose/sim/light/pixel_rays.h"
#include "evpose/sim/light/prepared_scene.h"
#include "evpose/sim/sensors/event_pixels.h"

namespace evpose {
class ConfigTable;
class ThreadPool;
}  // namespace evpose

namespace evpose::sim {

/// Resolution of the rendered luminance in time.
struct PixelIntegratorConfig {
  double step_px = 0.5;          ///< optical flow between two samples of a tile
  double block_px = 8;           ///< optical flow within a block
  double block_s = 0.02;         ///< longest block
  double max_flow_px_s = 20000;  ///< flights with a faster optical flow are refused
  double veiling_glare =
      0.02;  ///< fraction of the mean luminance of the image that the lens scatters over it
};
void describe(ConfigTable& table, PixelIntegratorConfig& config);

/// Exposure of one frame: the integral of luminance over time.
struct Exposure {
  TimeNs open = 0, close = 0;
  std::vector<float> sum;  ///< cd/m^2 s, row by row; sized by the caller
};

/// Amount of work, for reports.
struct PixelIntegratorCounts {
  std::int64_t blocks = 0, samples = 0, border_samples = 0, knots = 0;
};

/// Integrates the luminance of every pixel over time and feeds it to the event pixels and the exposures.
///
/// Time is divided into blocks of a few pixels of optical flow, for which the triangles are found that each
/// tile of the image may show. Within a block each tile is sampled at its own rate, half a pixel of flow
/// apart. Between two samples the luminance curve of a pixel is refined where it changes much: along the line
/// of the edge that crosses the pixel, or by further samples of the texture.
class PixelIntegrator {
 public:
  /// Keeps references, except for the config. `rays` are those of the camera.
  PixelIntegrator(const PreparedScene& prepared, const Camera& camera, const std::vector<PixelRay>& rays,
                  CameraPath path, const PixelIntegratorConfig& config, EventPixels& pixels,
                  ThreadPool& pool);
  ~PixelIntegrator();

  void start(TimeNs t);

  /// Advances by one block, not beyond `end`; returns its end. Appends the events of the block in order of
  /// time, then row, then column, and adds its luminance to `exposures`.
  TimeNs advance(TimeNs end, const std::vector<Exposure*>& exposures, std::vector<SimEvent>& events);

  const PixelIntegratorCounts& counts() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace evpose::sim
