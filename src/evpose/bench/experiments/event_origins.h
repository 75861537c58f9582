// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evpose/bench/experiments/recordings.h"

namespace evpose::experiments {

struct EventOriginsRequest {
  std::vector<std::string> recordings;   ///< folders made by `evpose simulate`
  std::vector<std::string> assignments;  ///< settings of the tracker, "key=value"
  double from_s = 0.3;                   ///< of the run: what is before does not count
};

/// What the tracker makes of the events of standing edges, of texture and of moving things, where the
/// simulator knows which is which.
Status print_event_origins(const EventOriginsRequest& request);

}  // namespace evpose::experiments
