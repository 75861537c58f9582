// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <list>
#include <string>
#include <vector>

#include "evpose/core/error.h"
#include "evpose/sim/sensors/pixel_integrator.h"
#include "evpose/sim/world/random.h"

namespace evpose {
class NewFolder;
}

namespace evpose::sim {

/// Grey-level frames beside the events, through the same lens.
struct FramesConfig {
  double rate_hz = 0;          ///< 0: none
  double exposure_ms = 8;      ///< luminance is averaged over it
  double white_cd_m2 = 0;      ///< luminance of white; 0: six times the median of the first frame
  double range_db = 60;        ///< dynamic range between black and white
  double full_well_e = 10000;  ///< electrons at white, which shot and read noise follow from; 0: no noise
};
void describe(ConfigTable& table, FramesConfig& config);

/// Grey value of a mean luminance: gamma curve between black and white.
std::uint8_t grey_value(double luminance, double white, double range_db);

/// What a pixel makes of a mean luminance: Poisson's noise of its electrons, as the Gaussian of the same
/// variance, and that of reading them.
double with_sensor_noise(double luminance, double white, double full_well_e, Random& random);

/// Writes frames/NNNNNN.png and frames/timestamps.csv. The time of a frame is the middle of its exposure.
class FrameCamera {
 public:
  /// Keeps a reference to the folder. `gain`: fraction of the light that reaches each pixel.
  static Expected<FrameCamera> create(const NewFolder& folder, const std::vector<float>& gain, ImageSize size,
                                      const FramesConfig& config, TimeNs end, std::uint64_t seed);

  /// Exposures that are open at some time in [t0, t1].
  std::vector<Exposure*> exposures(TimeNs t0, TimeNs t1);
  /// Writes the frames that are completely exposed at time `t`.
  Status write_finished(TimeNs t);
  Status finish();
  int written() const { return written_; }

 private:
  FrameCamera(const NewFolder& folder, const std::vector<float>& gain, ImageSize size,
              const FramesConfig& config, TimeNs end, std::uint64_t seed)
      : folder_(&folder),
        gain_(gain),
        size_(size),
        config_(config),
        white_(config.white_cd_m2),
        end_(end),
        seed_(seed) {}
  std::vector<std::uint8_t> read_out(const Exposure& exposure) const;

  const NewFolder* folder_;
  std::vector<float> gain_;
  ImageSize size_;
  FramesConfig config_;
  double white_;
  TimeNs end_;
  std::uint64_t seed_;
  int started_ = 0, written_ = 0;
  std::list<Exposure> open_;
  std::string stamps_;
};

/// Depth images: z at the centre of each pixel, moving objects included.
struct DepthConfig {
  double rate_hz = 0;  ///< 0: none
};
void describe(ConfigTable& table, DepthConfig& config);

/// Writes depth/NNNNNN.png, 16 bits, millimetres, 0 beyond 65.5 m and where there is no surface, and
/// depth/timestamps.csv.
Status write_depth(const NewFolder& folder, const PreparedScene& prepared, const std::vector<PixelRay>& rays,
                   ImageSize size, const std::function<Pose(double t_s)>& T_map_cam,
                   const DepthConfig& config, TimeNs end, ThreadPool& pool);

}  // namespace evpose::sim
