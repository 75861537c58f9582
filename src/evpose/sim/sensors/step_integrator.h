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
  static constexpr int kQuarters = 3;
  using QuarterViews = std::array<SceneView, kQuarters>;
  /// At the quarters between two views.
  static QuarterViews quarter_views(const SceneView& from, const SceneView& to);

  const PreparedScene& prepared;
  TileSampler& sampler;
  EventPixels& pixels;
  ImageSize size;
  const TilePlan& plan;
  std::array<std::reference_wrapper<const SceneView>, 2> views;  ///< of the two samples
  const QuarterViews& quarters;                                  ///< between them
  TimeNs t0, t1;
  const TileSamples &before, &after;
  float glare;  ///< cd/m^2
  const std::vector<Exposure*>& exposures;
  std::vector<SimEvent>& events;
  std::int64_t knots = 0;  ///< counts those between samples

  void integrate();

 private:
  /// Pixels whose luminance changes much, and how often their texture is sampled in between.
  struct Uneven {
    std::size_t count = 0;
    std::array<std::uint8_t, kTilePixels> pixel, between;
    std::array<std::size_t, kQuarters + 1> wanting{};  ///< pixels by number of samples in between
  };

  std::size_t index(std::size_t in_tile) const {
    return (plan.tile.y0 + in_tile / kTilePx) * size.width + plan.tile.x0 + in_tile % kTilePx;
  }
  void advance_even(Uneven& uneven);
  void add_uneven(std::size_t in_tile, Uneven& uneven) const;
  void advance_along(std::size_t in_tile, const LuminanceCurve& curve);
  void advance_uneven(const Uneven& uneven);
  void annotate(std::size_t in_tile, std::size_t first_event);
  void expose(std::size_t in_tile, const LuminanceCurve& curve);
};

}  // namespace evpose::sim
