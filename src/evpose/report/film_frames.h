// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>

#include "evpose/camera/camera.h"
#include "evpose/map/contour_map.h"
#include "evpose/report/overlay.h"
#include "evpose/report/run_files.h"

namespace evpose {

/// Pictures of a run with what it knew: the overlay, and beside it health in words and numbers, map and
/// trajectory from above, health and sigma over the time of the run.
class FilmFrames {
 public:
  /// Keeps a reference to `run`.
  FilmFrames(const RunFiles& run, const ContourMap& map, ImageSize overlay);
  ~FilmFrames();
  FilmFrames(const FilmFrames&) = delete;
  FilmFrames& operator=(const FilmFrames&) = delete;

  int width() const;
  int height() const;
  /// `row`: number of the update that the overlay is of.
  RgbImage draw(const RgbImage& overlay, std::size_t row);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace evpose
