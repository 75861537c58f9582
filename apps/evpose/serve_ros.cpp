// SPDX-License-Identifier: BSD-3-Clause
#include "serve_ros.h"

#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <vector>

namespace evpose {
namespace {

constexpr std::string_view kRos = "ros", kTopics = "ros://";

/// The node beside this program, or of that name in PATH.
std::string node_path() {
  std::error_code error;
  const auto self = std::filesystem::read_symlink("/proc/self/exe", error);
  const auto beside = self.parent_path() / "evpose_ros";
  return !error && std::filesystem::exists(beside, error) ? beside.string() : "evpose_ros";
}

/// "events,imu" of ros://events,imu; both have a usual name.
Expected<std::vector<std::string>> topics_of(const std::string& source) {
  if (source == kRos) return std::vector<std::string>{};
  const std::string names = source.substr(kTopics.size());
  const auto comma = names.find(',');
  if (comma == 0 || comma == std::string::npos || comma + 1 == names.size() ||
      std::count(names.begin(), names.end(), ',') != 1)
    return Error{source, "does not name two topics",
                 "write ros://EVENTS,IMU, or just ros for /events and /imu"};
  return std::vector<std::string>{"events:=" + names.substr(0, comma), "imu:=" + names.substr(comma + 1)};
}

}  // namespace

bool is_ros_address(const std::string& source) { return source == kRos || source.starts_with(kTopics); }

Error start_ros_node(const ServeRequest& request) {
  const TrackRequest& track = request.track;
  if (!request.mavlink.empty() || request.view >= 0 || !track.output.empty() || !track.config_file.empty())
    return {track.recording, "the ROS node has topics, and neither --mavlink, --view, --output nor --config",
            "leave them out, or let a driver send packets (docs/use/live.md)"};
  auto words = topics_of(track.recording);
  if (!words) return words.error();
  words->insert(words->begin(), node_path());
  const std::pair<const char*, const std::string*> parameters[] = {{"map", &track.map},
                                                                   {"calibration", &track.calibration},
                                                                   {"init", &track.init},
                                                                   {"imu_model", &track.imu_model},
                                                                   {"occluders", &track.occluders}};
  for (const auto& [name, value] : parameters)
    if (!value->empty() && *value != "auto") words->push_back("_" + std::string(name) + ":=" + *value);
  std::string settings;
  for (const std::string& assignment : track.assignments)
    settings += (settings.empty() ? "" : ", ") + ("'" + assignment + "'");
  if (!settings.empty()) words->push_back("_settings:=[" + settings + "]");
  std::vector<char*> pointers;
  for (std::string& word : *words) pointers.push_back(word.data());
  pointers.push_back(nullptr);
  ::execvp(pointers.front(), pointers.data());
  return {"evpose_ros", "the ROS node cannot be started",
          "build it with EVPOSE_ROS=ON, and put it beside evpose"};
}

}  // namespace evpose
