// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "evpose/core/config.h"
#include "evpose/core/error.h"

namespace evpose {

/// Sets what a named preset differs in from the defaults; an empty name changes nothing. Known: "paper", the
/// method of EV-Pose as far as it is implemented. Error: no such preset.
Status apply_preset(ConfigTable& table, const std::string& name);

}  // namespace evpose
