// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>

#include "evpose/camera/camera.h"
#include "evpose/core/error.h"
#include "evpose/map/contour_map.h"
#include "evpose/report/overlay.h"
#include "evpose/report/run_files.h"

namespace evpose {

/// The map over the events at moments of a run, made again from the recording and the map that it was made
/// from.
class RunPictures {
 public:
  /// Errors: a live run; a recording or map that is not there any more or cannot be read.
  static Expected<RunPictures> open(const RunFiles& run);
  RunPictures(RunPictures&&) noexcept;
  RunPictures& operator=(RunPictures&&) noexcept;
  ~RunPictures();

  /// In order of time. Errors: those of reading events.
  Expected<RgbImage> draw(const RunRow& row);

  const ContourMap& map() const;
  ImageSize size() const;

 private:
  struct State;
  explicit RunPictures(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

/// The map of a run, with the occluders that it was given.
Expected<ContourMap> read_run_map(const RunFiles& run);

}  // namespace evpose
