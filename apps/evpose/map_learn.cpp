// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_learn/map_learner.h"

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "commands.h"
#include "evpose/io/files/atomic_file.h"
#include "evpose/io/maps/contour_files.h"
#include "evpose/io/maps/map_h5.h"
#include "evpose/io/motion/trajectory_tum.h"
#include "evpose/run/progress.h"
#include "interrupt.h"
#include "map_changes.h"

namespace evpose {
namespace {

using map_learn::FlightReport;

struct LearnRequest {
  std::string map, output = "learnt.h5";
  std::vector<std::string> recordings, runs;
  std::string trajectories;  ///< folder for the adjusted flights; empty: none
  TrackRequest flight;       ///< settings of all
};

/// A direction in words, as far as there are any.
std::string axis_words(const Eigen::Vector3d& axis) {
  return text("(", std::round(100 * axis.x()) / 100, ", ", std::round(100 * axis.y()) / 100, ", ",
              std::round(100 * axis.z()) / 100, ")");
}

nlohmann::ordered_json as_json(const FlightReport& r) {
  const Eigen::Vector3d axis = r.common_axes.col(0);
  return {
      {"recording", r.recording},
      {"seconds", r.seconds},
      {"tracking_share", r.tracked},
      {"explained_events_before", r.explained_before},
      {"explained_events_after", r.explained_after},
      {"kept_m", r.lengths.kept_m},
      {"moved_m", r.lengths.moved_m},
      {"struck_m", r.lengths.struck_m},
      {"gone_m", r.lengths.gone_m},
      {"silent_m", r.lengths.silent_m},
      {"new_m", r.lengths.new_m},
      {"view_spread_deg", r.view_spread_deg},
      {"delay_px", r.delay_px},
      {"common_sigma_mm", {1e3 * r.common_sigma_m(0), 1e3 * r.common_sigma_m(1), 1e3 * r.common_sigma_m(2)}},
      {"weakest_direction", {axis.x(), axis.y(), axis.z()}},
      {"common_rotation_sigma_deg", r.common_rotation_sigma_rad * 57.29577951}};
}

void print_flight(const FlightReport& r) {
  std::printf(
      "flight     %s: %.1f s, tracked %.0f %%, contours seen from %.1f deg apart\n"
      "contours   %.1f m moved, %.1f m struck out, %.1f m gone, %.1f m new on planes, %.1f m of the map not "
      "told\n"
      "events     %.0f %% lie on contours, %.0f %% before\n"
      "frame      all together stand within %.1f mm (1 sigma) along %s, %.1f and %.1f mm across, %.3f deg\n",
      r.recording.c_str(), r.seconds, 100 * r.tracked, r.view_spread_deg, r.lengths.moved_m,
      r.lengths.struck_m, r.lengths.gone_m, r.lengths.new_m, r.lengths.kept_m, 100 * r.explained_after,
      100 * r.explained_before, 1e3 * r.common_sigma_m(0), axis_words(r.common_axes.col(0)).c_str(),
      1e3 * r.common_sigma_m(1), 1e3 * r.common_sigma_m(2), r.common_rotation_sigma_rad * 57.29577951);
  std::fflush(stdout);
}

Status write_trajectory(const std::string& folder, const map_learn::LearntMap& learnt, std::size_t number) {
  std::vector<TimedPose> poses;
  for (const FusionState& s : learnt.trajectory) poses.push_back({s.t, s.nav.T_map_body});
  std::error_code failed;
  std::filesystem::create_directories(folder, failed);
  return write_tum(text(folder, "/flight_", number, ".tum"), poses);
}

/// What would be lost, cannot be written, or does not belong together.
Status check_request(const LearnRequest& request) {
  if (!request.runs.empty() && request.runs.size() != request.recordings.size())
    return Error{"--run",
                 text("names ", request.runs.size(), " runs of ", request.recordings.size(), " recordings"),
                 "give one for each recording, in their order, or none"};
  std::error_code ignored;
  if (std::filesystem::equivalent(request.map, request.output, ignored))
    return Error{request.output, "is the map that is learnt from", "give another file with -o"};
  return {};
}

int learn(const LearnRequest& request) {
  if (const auto ok = check_request(request); !ok) return bad_input(ok.error());
  auto map = read_contour_map(request.map);
  if (!map) return bad_input(map.error());
  const auto placement = read_map_placement(request.map);
  if (!placement) return bad_input(placement.error());
  if (map->planes.empty() || map->polygons.empty())
    return bad_input({request.map, "has no planes: markings are learnt on planes",
                      "build the map from a cloud (evpose map build)"});
  const ContourMap given = *map;
  const InterruptGuard guard;
  nlohmann::ordered_json flights = nlohmann::ordered_json::array();
  Progress progress("learning");
  for (std::size_t i = 0; i < request.recordings.size(); ++i) {
    map_learn::Flight flight{request.flight, request.runs.empty() ? "" : request.runs[i]};
    flight.request.recording = request.recordings[i];
    flight.request.map = request.map;
    auto learnt = map_learn::learn_from_flight(flight, *map, [&](double share) {
      progress.at((static_cast<double>(i) + share) / static_cast<double>(request.recordings.size()));
      return !InterruptGuard::interrupted();
    });
    if (InterruptGuard::interrupted()) return kInterruptedStatus;
    if (!learnt) return bad_input(learnt.error());
    progress.done();
    print_flight(learnt->report);
    flights.push_back(as_json(learnt->report));
    if (!request.trajectories.empty())
      if (const auto ok = write_trajectory(request.trajectories, *learnt, i); !ok)
        return bad_input(ok.error());
    *map = std::move(learnt->map);
  }
  if (const auto ok = write_map_h5(request.output, *map, "", *placement); !ok) return bad_input(ok.error());
  const map_learn::MapChanges changes = map_learn::compare_dates(given, *map);
  std::printf("%s", words_of(changes).c_str());
  const nlohmann::ordered_json report{{"map", request.map},     {"output", request.output},
                                      {"flights", flights},     {"changes", json_of(changes)},
                                      {"processor_s", cpu_s()}, {"peak_memory_mb", peak_memory_mb()}};
  if (const auto ok = write_text_file(request.output + ".json", report.dump(2) + "\n"); !ok)
    return bad_input(ok.error());
  std::printf("output     %s; report in %s.json\n", request.output.c_str(), request.output.c_str());
  return 0;
}

}  // namespace

void add_map_learn(CLI::App& map, std::function<int()>& run) {
  auto request = std::make_shared<LearnRequest>();
  auto* command = map.add_subcommand(
      "learn", "Make a map better by flights through it: contours moved, struck out, learnt anew");
  command->add_option("map", request->map, "map with planes, as evpose map build makes it")->required();
  command->add_option("recordings", request->recordings, "flights, in the order in which they count")
      ->required();
  command->add_option("-o,--output", request->output, "map file; a report is written beside it")
      ->capture_default_str();
  command->add_option("--run", request->runs,
                      "run folders of the recordings, made with this map: they are not tracked again");
  command->add_option("--trajectories", request->trajectories, "folder for the adjusted trajectories (TUM)");
  command->add_option("--calibration", request->flight.calibration,
                      "of all recordings; default: the one found with each");
  command->add_option("--init", request->flight.init,
                      "start of each: as of evpose track; default: ground truth or initial_pose");
  command->add_option("--config", request->flight.config_file, "YAML file with settings");
  command->add_option("--set", request->flight.assignments, "one setting, key=value")
      ->allow_extra_args(false);
  command->callback([=, &run] { run = [=] { return learn(*request); }; });
}

}  // namespace evpose
