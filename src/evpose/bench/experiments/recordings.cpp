// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/bench/experiments/recordings.h"

#include <algorithm>
#include <filesystem>

namespace evpose::experiments {
namespace {

std::vector<BenchRecording> simulated_recordings(const std::string& folder) {
  std::vector<BenchRecording> out;
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator(folder, ignored)) {
    const std::string path = entry.path().string();
    if (std::filesystem::exists(path + "/contours.ply", ignored) &&
        std::filesystem::exists(path + "/events.h5", ignored))
      out.push_back({entry.path().filename().string(), path, path + "/contours.ply", path + "/mesh.ply"});
  }
  std::sort(out.begin(), out.end(), [](const auto& a, const auto& b) { return a.name < b.name; });
  return out;
}

}  // namespace

std::vector<BenchRecording> find_recordings(const std::string& folder) {
  std::error_code ignored;
  if (!std::filesystem::exists(folder + "/maps", ignored)) return simulated_recordings(folder);
  std::vector<BenchRecording> out;
  for (const char* name : {"room_spiral", "room_720p", "room_people", "room_hover", "courtyard_landing"}) {
    const std::string place = std::string(name).substr(0, std::string(name).find('_'));
    out.push_back({name, folder + "/" + name, folder + "/maps/" + place + "_contours.ply",
                   folder + "/maps/" + place + "_mesh.ply"});
  }
  return out;
}

Expected<std::vector<BenchRecording>> select_recordings(const Selection& selection) {
  std::vector<BenchRecording> found = find_recordings(selection.folder);
  const auto unwanted = [&](const BenchRecording& r) {
    const auto& only = selection.only;
    return !only.empty() && std::find(only.begin(), only.end(), r.name) == only.end();
  };
  found.erase(std::remove_if(found.begin(), found.end(), unwanted), found.end());
  for (BenchRecording& r : found)
    if (!selection.map.empty()) r.map = selection.map, r.occluders.clear();
  if (found.empty())
    return Error{selection.folder, "none of the wanted recordings is there",
                 "give the folder of the shared recordings or one that evpose simulate has filled"};
  return found;
}

Expected<RunConfig> configure(const std::vector<std::string>& assignments) {
  TrackRequest request;
  request.assignments = assignments;
  return load_config(request);
}

Expected<Streams> load_streams(const BenchRecording& recording, const RunConfig& config) {
  TrackRequest request;
  request.recording = recording.folder;
  request.map = recording.map;
  request.occluders = recording.occluders;
  return load_streams(request, config);
}

}  // namespace evpose::experiments
