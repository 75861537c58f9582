// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <string>

namespace evpose {

enum class LogLevel { quiet, normal, verbose };

/// Process-wide; the only global of the library. Never called from a hot loop.
void set_log_level(LogLevel level);
LogLevel log_level();

/// One line to stderr: "evpose: warning: ..." unless quiet.
void log_warning(const std::string& message);
/// Where warnings go instead of stderr; empty: stderr again. Not while other threads log.
void set_warning_sink(std::function<void(const std::string&)> sink);
/// One line to stderr, when verbose.
void log_detail(const std::string& message);

}  // namespace evpose
