// SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <functional>

#include "commands.h"
#include "evpose/core/log.h"
#include "evpose/core/version.h"
#include "usage.h"

namespace evpose {
namespace {

int run_program(int argc, char** argv) {
  CLI::App app{"evpose: where the drone is, from events, IMU and a prior 3D map"};
  app.set_version_flag("-V,--version", std::string("evpose ") + version());
  app.require_subcommand(1);
  app.footer(
      "Exit status: 0 done; 1 ran, but less than 90 % of it was tracked or a check failed; 2 bad input or "
      "usage.");
  bool verbose = false, quiet = false;
  app.add_flag("-v,--verbose", verbose, "say more");
  app.add_flag("-q,--quiet", quiet, "warnings and progress off");

  std::function<int()> run;
  add_demo(app, run);
  add_simulate(app, run);
  add_track(app, run);
  add_smooth(app, run);
  add_calibrate(app, run);
  add_check(app, run);
  add_eval(app, run);
  add_map(app, run);
  add_info(app, run);
  add_convert(app, run);
  add_serve(app, run);
  add_view(app, run);
  add_render(app, run);
  add_mavlink(app, run);
  add_bench(app, run);
  add_manual(app, run);
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& e) {
    return app.exit(e);  // --help, --version
  } catch (const CLI::ParseError& e) {
    if (const auto wrong = find_unknown_word(app, {argv + 1, argv + argc})) return bad_input(*wrong);
    std::fprintf(stderr, "evpose: %s; see evpose --help\n", e.what());
    return 2;
  }
  set_log_level(quiet ? LogLevel::quiet : verbose ? LogLevel::verbose : LogLevel::normal);
  return run();
}

}  // namespace
}  // namespace evpose

int main(int argc, char** argv) {
  try {
    return evpose::run_program(argc, argv);
  } catch (const std::bad_alloc&) {
    std::fprintf(stderr, "evpose: out of memory; free some or use a smaller map\n");
  } catch (const std::exception& e) {
    std::fprintf(stderr, "evpose: %s; please report this\n", e.what());
  }
  return 2;
}
