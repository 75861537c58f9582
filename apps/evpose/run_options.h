// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "evpose/run/track_recording.h"

namespace CLI {
class App;
}

namespace evpose {

/// The options of the commands that make something of a recording: map, calibration (by this name), start,
/// settings.
void add_input_options(CLI::App& command, TrackRequest& request, const std::string& calibration);

/// The same and the run folder, for the commands that make a run.
void add_run_options(CLI::App& command, TrackRequest& request);

/// Prints all settings of the request; the exit status.
int dump_config(const TrackRequest& request);

}  // namespace evpose
