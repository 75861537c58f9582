// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <string>

#include "evpose/core/error.h"

namespace evpose {

struct FilmRequest {
  std::string run, output;               ///< .mp4, .gif, or a folder for pictures
  double fps = 25;                       ///< pictures a second
  double speed = 1;                      ///< seconds of the run in a second of the film
  double start_s = 0, duration_s = 1e9;  ///< of the run; what lies beyond its end is left out
  std::function<bool(double)> progress;  ///< told the share done; false ends it, and nothing is written
};

/// Draws a run and writes it as a film, by ffmpeg, or as PNG pictures, frame_00000.png and so on, into a
/// folder. Gives the number of pictures, 0 if interrupted. Nothing is written on error.
Expected<std::size_t> render_film(const FilmRequest& request);

}  // namespace evpose
