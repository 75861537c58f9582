// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/core/log.h"

#include <atomic>
#include <cstdio>

namespace evpose {
namespace {
std::atomic<LogLevel> g_level{LogLevel::normal};
std::function<void(const std::string&)> g_warning_sink;
}  // namespace

void set_log_level(LogLevel level) { g_level = level; }
LogLevel log_level() { return g_level; }

void set_warning_sink(std::function<void(const std::string&)> sink) { g_warning_sink = std::move(sink); }

void log_warning(const std::string& message) {
  if (g_warning_sink) return g_warning_sink(message);
  if (g_level != LogLevel::quiet) std::fprintf(stderr, "evpose: warning: %s\n", message.c_str());
}

void log_detail(const std::string& message) {
  if (g_level == LogLevel::verbose) std::fprintf(stderr, "evpose: %s\n", message.c_str());
}

}  // namespace evpose
