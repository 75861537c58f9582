// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "evpose/core/config.h"
#include "evpose/core/error.h"

namespace evpose {

/// Sets keys from a YAML file, nested or dotted. Errors carry file and line; keys before the wrong one stay
/// set.
Status apply_yaml(ConfigTable& table, const std::string& path);

/// Sets one key from "key=value".
Status apply_assignment(ConfigTable& table, const std::string& assignment);

}  // namespace evpose
