// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_learn/map_learner.h"

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "commands.h"
#include "evpose/core/log.h"
#include "evpose/core/version.h"
#include "evpose/io/files/atomic_file.h"
#include "evpose/io/maps/contour_files.h"
#include "evpose/io/maps/map_h5.h"
#include "evpose/io/motion/trajectory_tum.h"
#include "evpose/map_learn/tracked_run.h"
#include "evpose/run/progress.h"
#include "interrupt.h"
#include "learnt_flights.h"
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
      "contours   %.1f m moved, %.1f m struck out, %.1f m gone, %.1f m new, %.1f m of the map not "
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
  const auto folder = std::filesystem::absolute(request.output, ignored).parent_path();
  if (!std::filesystem::is_directory(folder, ignored))
    return Error{request.output, "its folder does not exist", "make it first"};
  for (const std::string& recording : request.recordings)
    if (!std::filesystem::exists(recording, ignored))
      return Error{recording, "does not exist", "give recordings that are there"};
  if (std::filesystem::equivalent(request.map, request.output, ignored))
    return Error{request.output, "is the map that is learnt from", "give another file with -o"};
  return {};
}

/// One learning, flight after flight.
class Learning {
 public:
  Learning(const LearnRequest& request, ContourMap map, const MapPlacement& placement)
      : request_(request),
        given_(map),
        map_(std::move(map)),
        placement_(placement),
        kept_(request.output, placement) {}

  /// The exit status.
  int run();

 private:
  Status learn_from(std::size_t number);
  Status write_results();
  nlohmann::ordered_json inputs_until(std::size_t number) const;

  const LearnRequest& request_;
  const ContourMap given_;
  ContourMap map_;
  MapPlacement placement_;
  LearntFlights kept_;
  nlohmann::ordered_json flights_ = nlohmann::ordered_json::array();
  Progress progress_{"learning"};
};

/// All that the map after this flight depends on.
nlohmann::ordered_json Learning::inputs_until(std::size_t number) const {
  std::error_code ignored;
  const auto path = [](const std::string& p) {
    return p.empty() ? p : std::filesystem::absolute(p).lexically_normal().string();
  };
  nlohmann::ordered_json out{
      {"evpose", version()},
      {"map", path(request_.map)},
      {"map_bytes", std::filesystem::file_size(request_.map, ignored)},
      {"map_time", std::filesystem::last_write_time(request_.map, ignored).time_since_epoch().count()},
      {"calibration", path(request_.flight.calibration)},
      {"init", request_.flight.init}};
  ConfigTable table;
  if (auto config = load_config(request_.flight)) {
    describe(table, *config);
    out["config"] = table.to_yaml();
  }
  for (std::size_t i = 0; i <= number; ++i) {
    out["recordings"].push_back(path(request_.recordings[i]));
    if (!request_.runs.empty()) out["runs"].push_back(path(request_.runs[i]));
  }
  return out;
}

Status Learning::learn_from(std::size_t number) {
  map_learn::Flight flight{request_.flight, request_.runs.empty() ? "" : request_.runs[number]};
  flight.request.recording = request_.recordings[number];
  flight.request.map = request_.map;
  const auto flights = static_cast<double>(request_.recordings.size());
  auto learnt = map_learn::learn_from_flight(flight, map_, [&](double share) {
    progress_.at((static_cast<double>(number) + share) / flights);
    return !InterruptGuard::interrupted();
  });
  if (!learnt) return learnt.error();
  if (InterruptGuard::interrupted()) return {};
  progress_.done();
  print_flight(learnt->report);
  flights_.push_back(as_json(learnt->report));
  if (!request_.trajectories.empty())
    if (auto ok = write_trajectory(request_.trajectories, *learnt, number); !ok) return ok;
  map_ = std::move(learnt->map);
  if (number + 1 == request_.recordings.size()) return {};
  auto kept = kept_.keep(number, inputs_until(number), flights_.back(), map_);
  if (!kept) return kept.error();
  map_ = *std::move(kept);
  map_.source = given_.source;
  return {};
}

Status Learning::write_results() {
  if (auto ok = write_map_h5(request_.output, map_, "", placement_); !ok) return ok;
  const map_learn::MapChanges changes = map_learn::compare_dates(given_, map_);
  std::printf("%s", words_of(changes).c_str());
  const nlohmann::ordered_json report{{"map", request_.map},    {"output", request_.output},
                                      {"flights", flights_},    {"changes", json_of(changes)},
                                      {"processor_s", cpu_s()}, {"peak_memory_mb", peak_memory_mb()}};
  if (auto ok = write_text_file(request_.output + ".json", report.dump(2) + "\n"); !ok) return ok;
  kept_.remove();
  std::printf("output     %s; report in %s.json\n", request_.output.c_str(), request_.output.c_str());
  return {};
}

int Learning::run() {
  const InterruptGuard guard;
  for (std::size_t i = 0; i < request_.recordings.size(); ++i) {
    if (auto done = kept_.read(i, inputs_until(i)); done && i + 1 < request_.recordings.size()) {
      std::printf("flight     %s: done before\n", request_.recordings[i].c_str());
      flights_.push_back(done->report);
      map_ = std::move(done->map);
      map_.source = given_.source;
      continue;
    }
    if (const auto ok = learn_from(i); !ok) return bad_input(ok.error());
    if (!InterruptGuard::interrupted()) continue;
    if (kept_.any())
      std::fprintf(stderr, "evpose: interrupted; the same command goes on after the flights that are done\n");
    return kInterruptedStatus;
  }
  const auto ok = write_results();
  return ok ? 0 : bad_input(ok.error());
}

int learn(const LearnRequest& request) {
  if (const auto ok = check_request(request); !ok) return bad_input(ok.error());
  auto map = read_contour_map(request.map);
  if (!map) return bad_input(map.error());
  const auto placement = read_map_placement(request.map);
  if (!placement) return bad_input(placement.error());
  if (map->planes.empty() || map->polygons.empty())
    log_warning(
        text(request.map, ": has no planes, on which markings are learnt; evpose map build finds them"));
  for (std::size_t i = 0; i < request.runs.size(); ++i)
    if (const auto run = map_learn::read_run_of(request.runs[i], request.recordings[i], request.map); !run)
      return bad_input(run.error());
  return Learning(request, *std::move(map), *placement).run();
}

}  // namespace

void add_map_learn(CLI::App& map, std::function<int()>& run) {
  auto request = std::make_shared<LearnRequest>();
  auto* command = map.add_subcommand(
      "learn", "Make a map better by flights through it: contours moved, struck out, learnt anew");
  command->add_option("map", request->map, "map, with planes best, as evpose map build makes it")->required();
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
