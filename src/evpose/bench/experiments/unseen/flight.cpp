// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/bench/experiments/unseen/flight.h"

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>

#include "evpose/core/parallel.h"
#include "evpose/io/files/atomic_file.h"
#include "evpose/io/maps/cloud_files.h"
#include "evpose/io/maps/map_h5.h"
#include "evpose/map_build/map_builder.h"
#include "evpose/sim/recording/recording_maker.h"

namespace evpose::experiments::unseen {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kMostAttempts = 30;

/// Written last: a folder with it is complete.
std::string note_path(const Flight& flight) { return flight.folder + "/flight.json"; }

Status write_note(const Flight& flight) {
  const Json note{{"draw", flight.draw.key()},
                  {"refused", flight.refused},
                  {"duration_s", flight.duration_s},
                  {"mev_s", flight.mev_s},
                  {"map_fault", flight.map_fault}};
  return write_text_file(note_path(flight), note.dump(1) + "\n");
}

/// The flight in the folder, if it is complete and still what the seed draws.
std::optional<Flight> find_flight(const FlightRequest& request) {
  Flight flight;
  flight.folder = request.folder;
  const auto content = read_text_file(note_path(flight));
  if (!content) return std::nullopt;
  const Json note = Json::parse(*content, nullptr, false);
  if (!note.is_object()) return std::nullopt;
  flight.refused = note.value("refused", std::vector<std::string>{});
  flight.duration_s = note.value("duration_s", 0.0);
  flight.mev_s = note.value("mev_s", 0.0);
  flight.map_fault = note.value("map_fault", "");
  flight.draw = draw_flight(request.seed, static_cast<int>(flight.refused.size()), request.quick);
  if (note.value("draw", "") != flight.draw.key()) return std::nullopt;
  return flight;
}

/// By what the simulator names: the draw is at fault, not the disk.
bool cannot_be_flown(const Error& error) {
  const auto names = [&](const char* setting) { return error.where.starts_with(setting); };
  return names("trajectory") || names("scenario") || names("handed_over") || names("lidar.moved_furniture");
}

Status build_map(Flight& flight, int threads) {
  flight.map_fault.clear();
  auto cloud = read_cloud(flight.folder + "/map_raw.ply");
  if (!cloud) return cloud.error();
  ThreadPool pool(threads);
  const auto built = map_build::build_map(*std::move(cloud), {}, pool, [](double) { return true; });
  if (built) return write_map_h5(flight.map_path(), built->map);
  flight.map_fault = built.error().what;
  return {};
}

/// Makes the first draw that can be flown.
Expected<Flight> make_flight(const FlightRequest& request) {
  Flight flight;
  flight.folder = request.folder;
  for (int attempt = 0; attempt < kMostAttempts; ++attempt) {
    flight.draw = draw_flight(request.seed, attempt, request.quick);
    const auto scenario = scenario_of(flight.draw);
    if (!scenario) return scenario.error();
    const auto made = sim::make_recording(*scenario, request.folder, request.threads, {});
    if (made) {
      flight.duration_s = made->duration_s;
      flight.mev_s = 1e-6 * static_cast<double>(made->read_out.delivered) / made->duration_s;
      return flight;
    }
    if (!cannot_be_flown(made.error())) return made.error();
    flight.refused.push_back(made.error().what);
  }
  return Error{text("seed ", request.seed), text("none of ", kMostAttempts, " draws can be flown"),
               "leave it out with --from and --seeds"};
}

}  // namespace

Expected<Flight> provide_flight(const FlightRequest& request) {
  std::optional<Flight> flight = find_flight(request);
  const bool found = flight.has_value();
  if (!found) {
    auto made = make_flight(request);
    if (!made) return made.error();
    flight = *std::move(made);
  }
  if (found && !request.rebuild_map) return *flight;
  if (Status done = build_map(*flight, request.threads); !done) return done.error();
  if (Status done = write_note(*flight); !done) return done.error();
  return *flight;
}

}  // namespace evpose::experiments::unseen
