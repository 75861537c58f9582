// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "evpose/core/time.h"
#include "evpose/sim/light/luminance_curve.h"
#include "evpose/sim/light/tile_sampler.h"
#include "evpose/sim/sensors/event_pixels.h"
#include "evpose/sim/sensors/pixel_integrator.h"

namespace evpose::sim {

/// Integrates every pixel of a tile from one sample to the next.
struct StepIntegrator {
  const PreparedScene& prepared;
  TileSampler& sampler;
  EventPixels& pixels;
  ImageSize size;
  const TilePlan& plan;
  std::array<std::reference_wrapper<const SceneView>, 2> views;  ///< of the two samples
  TimeNs t0, t1;
  const TileSamples &before, &after;
  float glare;  ///< cd/m^2
  const std::vector<Exposure*>& exposures;
  std::vector<SimEvent>& events;
  std::int64_t knots = 0;  ///< counts those between samples

  void integrate();

 private:
  static constexpr int kQuarters = 3;
  struct Resampled {
    std::array<float, kTilePixels> luminance;
  };

  std::size_t index(std::size_t in_tile) const {
    return (plan.tile.y0 + in_tile / kTilePx) * size.width + plan.tile.x0 + in_tile % kTilePx;
  }
  void advance_even(std::vector<std::uint16_t>& uneven);
  void advance_along(std::size_t in_tile, const LuminanceCurve& curve);
  void advance_uneven(const std::vector<std::uint16_t>& uneven);
  void annotate(std::size_t in_tile, std::size_t first_event);
  void expose(std::size_t in_tile, const LuminanceCurve& curve);
};

}  // namespace evpose::sim
