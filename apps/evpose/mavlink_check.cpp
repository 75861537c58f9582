// SPDX-License-Identifier: BSD-3-Clause
#include <poll.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>

#include "commands.h"
#include "evpose/mavlink/link.h"
#include "evpose/mavlink/link_check.h"
#include "interrupt.h"

namespace evpose {
namespace {

int listen(const std::string& address, double seconds) {
  auto link = mavlink::Link::open(address);
  if (!link) return bad_input(link.error());
  mavlink::LinkCheck check;
  const InterruptGuard guard;
  const TimeNs until = monotonic_ns() + from_seconds(seconds);
  while (!InterruptGuard::interrupted() && monotonic_ns() < until) {
    pollfd waiting{(*link)->descriptor(), POLLIN, 0};
    ::poll(&waiting, 1, 50);
    const auto bytes = (*link)->receive();
    const TimeNs now = monotonic_ns();
    if (!bytes.empty()) check.receive(bytes, now);
    if (const std::string notice = (*link)->take_notice(); !notice.empty())
      std::fprintf(stderr, "evpose: %s\n", notice.c_str());
  }
  const auto report = check.report();
  for (const std::string& line : report.lines) std::printf("%s\n", line.c_str());
  for (const std::string& fault : report.faults) std::printf("FAULT: %s\n", fault.c_str());
  return report.faults.empty() ? 0 : 1;
}

}  // namespace

void add_mavlink(CLI::App& app, std::function<int()>& run) {
  auto* command = app.add_subcommand("mavlink", "Look at a MAVLink connection");
  command->require_subcommand(1);
  auto* check = command->add_subcommand(
      "check", "Listen, and say rates, gaps, frames, delay, covariances and what the autopilot reports");
  auto address = std::make_shared<std::string>();
  auto seconds = std::make_shared<double>(10);
  check->add_option("link", *address, "udpin://HOST:PORT, or serial:///dev/ttyX:BAUD")->required();
  check->add_option("--seconds", *seconds, "how long, s")->capture_default_str()->check(CLI::Range(0.1, 1e6));
  check->callback([=, &run] { run = [=] { return listen(*address, *seconds); }; });
}

}  // namespace evpose
