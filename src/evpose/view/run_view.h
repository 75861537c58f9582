// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "evpose/core/error.h"
#include "evpose/view/viewer.h"

namespace evpose {

/// The poses of a run folder for the page, thinned to `most` rows. Errors: no run, or a states.csv that
/// cannot be read, with its line.
Expected<std::vector<ViewRow>> read_run(const std::string& folder, std::size_t most = 20'000);

}  // namespace evpose
