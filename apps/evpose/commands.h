// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdio>
#include <functional>

#include "evpose/core/error.h"
#include "evpose/map/contour_map.h"

namespace CLI {
class App;
}

namespace evpose {

struct RunOutcome;

// Each adds one subcommand, which stores in `run` what is to be done if it was the one asked for. That
// returns the exit status: 0 done; 1 ran, but tracked too little of it or a check failed; 2 bad input.
void add_demo(CLI::App& app, std::function<int()>& run);
void add_simulate(CLI::App& app, std::function<int()>& run);
void add_track(CLI::App& app, std::function<int()>& run);
void add_calibrate(CLI::App& app, std::function<int()>& run);
void add_smooth(CLI::App& app, std::function<int()>& run);
void add_check(CLI::App& app, std::function<int()>& run);
void add_eval(CLI::App& app, std::function<int()>& run);
void add_map(CLI::App& app, std::function<int()>& run);
void add_map_build(CLI::App& map, std::function<int()>& run);
void add_map_board(CLI::App& map, std::function<int()>& run);
void add_map_depth(CLI::App& map, std::function<int()>& run);
void add_map_merge(CLI::App& map, std::function<int()>& run);
void add_map_compare(CLI::App& map, std::function<int()>& run);
void add_map_changes(CLI::App& map, std::function<int()>& run);
void add_map_index(CLI::App& map, std::function<int()>& run);
void add_map_learn(CLI::App& map, std::function<int()>& run);
void add_convert(CLI::App& app, std::function<int()>& run);
void add_info(CLI::App& app, std::function<int()>& run);
void add_serve(CLI::App& app, std::function<int()>& run);
void add_view(CLI::App& app, std::function<int()>& run);
void add_render(CLI::App& app, std::function<int()>& run);
void add_mavlink(CLI::App& app, std::function<int()>& run);
void add_manual(CLI::App& app, std::function<int()>& run);
void add_bench(CLI::App& app, std::function<int()>& run);

/// A map as a whole; of one with points.
struct MapFigures {
  std::size_t contours = 0;
  double length_m = 0;
  std::array<double, kContourKinds> by_kind_m{};
  Eigen::Vector3d low = Eigen::Vector3d::Zero(), high = Eigen::Vector3d::Zero();  ///< bounds, map frame
};
MapFigures figures_of(const ContourMap& map);

/// Says what is wrong in one line on stderr; the exit status for it.
inline int bad_input(const Error& error) {
  std::fprintf(stderr, "evpose: %s\n", error.line().c_str());
  return 2;
}

/// Prints how a run ended; the exit status for it.
int report_run(const Expected<RunOutcome>& outcome);

}  // namespace evpose
