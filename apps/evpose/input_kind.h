// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "evpose/core/error.h"

namespace evpose {

enum class InputKind { recording, events, imu, trajectory, map, calibration };

/// What a file or folder is, by content where that tells, else by name. Errors: no such file, nothing known.
Expected<InputKind> kind_of_input(const std::string& path);

}  // namespace evpose
