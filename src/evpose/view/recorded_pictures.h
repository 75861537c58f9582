// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "evpose/map/contour_map.h"
#include "evpose/report/run_files.h"
#include "evpose/view/server.h"

namespace evpose {

/// Pictures of a run for the page, drawn again in the background from what the run was made from: /picture/0,
/// /picture/1, ... as they come, and /pictures.json: {"t": seconds since the first pose, "made": how many are
/// there, "fault": why there will be no more, empty if all is well}.
class RecordedPictures {
 public:
  /// `run` has poses. Keeps a reference to `server`, which must live longer.
  RecordedPictures(Server& server, RunFiles run, ContourMap map);
  /// Ends the drawing.
  ~RecordedPictures();
  RecordedPictures(const RecordedPictures&) = delete;
  RecordedPictures& operator=(const RecordedPictures&) = delete;

 private:
  struct Progress;  ///< shared with the page, which may be asked for while this ends
  Status draw_all(ContourMap map);

  Server& server_;
  RunFiles run_;
  std::vector<std::size_t> rows_;  ///< of the run, one for each picture
  std::shared_ptr<Progress> progress_;
  std::atomic<bool> stop_{false};
  std::thread thread_;  ///< last: it reads the others
};

}  // namespace evpose
