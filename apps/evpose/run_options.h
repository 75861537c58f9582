// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evpose/run/track_recording.h"

namespace CLI {
class App;
}

namespace evpose {

/// The options of the commands that make a run of a recording: map, calibration, start, settings, run folder.
void add_run_options(CLI::App& command, TrackRequest& request);

/// Prints all settings of the request; the exit status.
int dump_config(const TrackRequest& request);

}  // namespace evpose
