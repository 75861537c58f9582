// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>

#include "evpose/camera/camera.h"
#include "evpose/core/error.h"
#include "evpose/map/contour_map.h"
#include "evpose/report/overlay.h"
#include "evpose/report/run_files.h"
#include "evpose/tracker/snapshot.h"

namespace evpose {

/// The map over the events at moments of a run, made again from the recording that it was made from.
class RunPictures {
 public:
  /// `map`: that of the run, read_run_map(); without points the events alone are drawn. Errors: a live run; a
  /// recording that is not there any more or cannot be read.
  static Expected<RunPictures> open(const RunFiles& run, ContourMap map);
  RunPictures(RunPictures&&) noexcept;
  RunPictures& operator=(RunPictures&&) noexcept;
  ~RunPictures();

  /// The events of a moment and the map's points in the image; the surface is that of the latest moment.
  struct Moment {
    const TimeSurface& surface;
    std::uint32_t now_us;
    std::vector<Snapshot::Point> points;  ///< none where there was no pose
  };
  /// In order of time. Errors: those of reading events.
  Expected<Moment> look(const RunRow& row);
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
