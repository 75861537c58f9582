// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "evpose/core/config.h"
#include "evpose/core/error.h"

namespace evpose {

/// Sets keys from a YAML file, nested or dotted. Errors carry file and line; keys before the wrong one stay
/// set.
Status apply_yaml(ConfigTable& table, const std::string& path);

/// Sets one key from "key=value".
Status apply_assignment(ConfigTable& table, const std::string& assignment);
Status apply_assignments(ConfigTable& table, const std::vector<std::string>& assignments);

/// Sets keys from a YAML file, if one is named, and then from assignments.
Status apply_settings(ConfigTable& table, const std::string& path,
                      const std::vector<std::string>& assignments);

}  // namespace evpose
