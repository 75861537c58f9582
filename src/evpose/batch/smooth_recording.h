// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evpose/run/track_recording.h"

namespace evpose {

/// The trajectory from all data of a recording, past and future, with its covariance: a run folder as
/// track_recording() writes it. An interrupted run writes nothing; `outcome` is then empty.
Expected<std::optional<RunOutcome>> smooth_recording(const TrackRequest& request);

}  // namespace evpose
