// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/core/log.h"

#include <atomic>
#include <cstdio>

namespace evpose {
namespace {
std::atomic<LogLevel> g_level{LogLevel::normal};
}

void set_log_level(LogLevel level) { g_level = level; }
LogLevel log_level() { return g_level; }

void log_warning(const std::string& message) {
  if (g_level != LogLevel::quiet) std::fprintf(stderr, "evpose: warning: %s\n", message.c_str());
}

void log_detail(const std::string& message) {
  if (g_level == LogLevel::verbose) std::fprintf(stderr, "evpose: %s\n", message.c_str());
}

}  // namespace evpose
