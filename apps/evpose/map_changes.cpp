// SPDX-License-Identifier: BSD-3-Clause
#include "map_changes.h"

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <memory>

#include "commands.h"
#include "evpose/io/maps/contour_files.h"

namespace evpose {
namespace {

using map_learn::Change;
using map_learn::MapChanges;

struct ChangesRequest {
  std::string before, after;
  bool json = false;
};

int print_changes(const ChangesRequest& request) {
  const auto before = read_contour_map(request.before);
  if (!before) return bad_input(before.error());
  const auto after = read_contour_map(request.after);
  if (!after) return bad_input(after.error());
  const MapChanges changes = map_learn::compare_dates(*before, *after);
  std::fputs(request.json ? (json_of(changes).dump(2) + "\n").c_str() : words_of(changes).c_str(), stdout);
  return 0;
}

nlohmann::ordered_json rounded(const Eigen::Vector3d& v) {
  nlohmann::ordered_json out;
  for (int i = 0; i < 3; ++i) out.push_back(std::round(1e5 * v(i)) / 1e5);
  return out;
}

}  // namespace

std::string words_of(const MapChanges& changes) {
  char out[300];
  std::snprintf(
      out, sizeof out,
      "changes    %zu pieces, %.1f m moved, half of them by more than %.1f mm; %zu pieces, %.1f m gone; "
      "%zu pieces, %.1f m new; %.1f m the same\n",
      changes.count(Change::moved), changes.length_m(Change::moved), 1e3 * changes.median_moved_m(),
      changes.count(Change::gone), changes.length_m(Change::gone), changes.count(Change::added),
      changes.length_m(Change::added), changes.same_m);
  return out;
}

nlohmann::ordered_json json_of(const MapChanges& changes) {
  nlohmann::ordered_json out{{"same_m", changes.same_m}};
  for (const Change kind : {Change::moved, Change::gone, Change::added})
    out[map_learn::kChangeNames[static_cast<std::size_t>(kind)]] = {{"pieces", changes.count(kind)},
                                                                    {"m", changes.length_m(kind)}};
  out["moved"]["median_m"] = changes.median_moved_m();
  out["pieces"] = nlohmann::ordered_json::array();
  for (const map_learn::ContourChange& c : changes.changes) {
    nlohmann::ordered_json piece{{"change", map_learn::kChangeNames[static_cast<std::size_t>(c.change)]},
                                 {"at_m", rounded(c.middle)},
                                 {"length_m", std::round(1e4 * c.length_m) / 1e4}};
    if (c.change == Change::moved) piece["moved_m"] = rounded(c.moved_m);
    piece["sigma_m"] = std::round(1e5 * c.sigma_m) / 1e5;
    out["pieces"].push_back(piece);
  }
  return out;
}

void add_map_changes(CLI::App& map, std::function<int()>& run) {
  auto request = std::make_shared<ChangesRequest>();
  auto* command = map.add_subcommand("changes", "What moved, went and came between two maps of one place");
  command->add_option("before", request->before, "the older map")->required();
  command->add_option("after", request->after, "the newer map, in the same frame")->required();
  command->add_flag("--json", request->json, "each change with its place, for programs");
  command->callback([=, &run] { run = [=] { return print_changes(*request); }; });
}

}  // namespace evpose
