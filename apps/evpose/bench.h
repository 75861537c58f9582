// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace evpose {

// Each adds one bench under `evpose bench` and sets `run` when asked for.
void add_bench_fusion(CLI::App& bench, std::function<int()>& run);
void add_bench_calibration(CLI::App& bench, std::function<int()>& run);
void add_bench_capture(CLI::App& bench, std::function<int()>& run);
void add_bench_events(CLI::App& bench, std::function<int()>& run);
void add_bench_faults(CLI::App& bench, std::function<int()>& run);
void add_bench_picture(CLI::App& bench, std::function<int()>& run);

/// The shared recordings of a folder with `maps`, by name: the room's and the courtyard's. Of a folder
/// without, all recordings that `evpose simulate` has put there.
struct PeerRecording {
  std::string name, folder, map, occluders;
};
std::vector<PeerRecording> peer_recordings(const std::string& folder);

}  // namespace evpose
