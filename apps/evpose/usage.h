// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "evpose/core/error.h"

namespace CLI {
class App;
}

namespace evpose {

/// The first word that is no command or long option where it stands, with the nearest that is; unset: all
/// are known. `words`: the command line after the program's name.
std::optional<Error> find_unknown_word(const CLI::App& app, const std::vector<std::string>& words);

}  // namespace evpose
