// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/core/time.h"
#include "evpose/sim/flight/motion.h"
#include "evpose/sim/light/pixel_rays.h"
#include "evpose/sim/light/stage.h"
#include "evpose/sim/sensors/event_pixels.h"

namespace evpose {
class ConfigTable;
class ThreadPool;
}  // namespace evpose

namespace evpose::sim {

/// How finely light is followed in time.
struct FilmConfig {
  double step_px = 0.5;         ///< motion of the picture between two samples of a tile
  double block_px = 5;          ///< ... between two looks at which surface is where
  double block_s = 0.01;        ///< longest time between these
  double fastest_px_s = 20000;  ///< flights that move the picture faster are refused
  double veiling_glare = 0.02;  ///< share of the picture's mean luminance that the lens scatters over it
};
void describe(ConfigTable& table, FilmConfig& config);

/// A picture that is being exposed: luminance over time, added up.
struct Exposure {
  TimeNs open = 0, close = 0;
  std::vector<float> sum;  ///< cd/m^2 s, row by row; sized by whoever starts it
};

/// What happens to the work, for reports.
struct FilmCounts {
  std::int64_t blocks = 0, samples = 0, open_samples = 0, knots = 0;
};

/// Follows the luminance of every pixel through time and drives the event pixels with it.
///
/// Time is cut into blocks of a few pixels of motion. At their borders rays tell which surface each pixel
/// sees; where that is one surface for some way around, at both ends, the block needs no more rays there.
/// Within a block each tile of the image is sampled at times of its own, half a pixel of motion apart, and
/// between two samples the course of a pixel's luminance is refined where it changes much: along the line of
/// the edge that crosses the pixel, or by further looks at the texture.
class Film {
 public:
  /// Keeps references, but for the config. `rays` are those of the camera.
  Film(const Stage& stage, const Camera& camera, const std::vector<PixelRay>& rays, CameraPath path,
       const FilmConfig& config, EventPixels& pixels, ThreadPool& pool);
  ~Film();

  void start(TimeNs t);

  /// Goes on by one block, not beyond `end`; returns its end. Appends the block's events in order of time,
  /// then row, then column. `exposures` get their share.
  TimeNs advance(TimeNs end, const std::vector<Exposure*>& exposures, std::vector<SimEvent>& events);

  const FilmCounts& counts() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace evpose::sim
