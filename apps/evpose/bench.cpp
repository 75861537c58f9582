// SPDX-License-Identifier: BSD-3-Clause
#include "bench.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>

#include "commands.h"

namespace evpose {

std::vector<PeerRecording> peer_recordings(const std::string& folder) {
  std::vector<PeerRecording> out;
  if (std::error_code ignored; !std::filesystem::exists(folder + "/maps", ignored)) {
    for (const auto& entry : std::filesystem::directory_iterator(folder, ignored)) {
      const std::string path = entry.path().string();
      if (std::filesystem::exists(path + "/contours.ply", ignored) &&
          std::filesystem::exists(path + "/events.h5", ignored))
        out.push_back({entry.path().filename().string(), path, path + "/contours.ply", path + "/mesh.ply"});
    }
    std::sort(out.begin(), out.end(), [](const auto& a, const auto& b) { return a.name < b.name; });
    return out;
  }
  for (const char* name : {"room_spiral", "room_720p", "room_people", "room_hover", "courtyard_landing"}) {
    const std::string scene = std::string(name).substr(0, std::string(name).find('_'));
    out.push_back({name, folder + "/" + name, folder + "/maps/" + scene + "_contours.ply",
                   folder + "/maps/" + scene + "_mesh.ply"});
  }
  return out;
}

void add_bench(CLI::App& app, std::function<int()>& run) {
  auto* bench = app.add_subcommand("bench", "Measure and print the tables of the documentation");
  bench->require_subcommand(1);
  add_bench_fusion(*bench, run);
  add_bench_calibration(*bench, run);
  add_bench_capture(*bench, run);
  add_bench_events(*bench, run);
  add_bench_faults(*bench, run);
  add_bench_picture(*bench, run);
}

}  // namespace evpose
