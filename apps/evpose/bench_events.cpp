// SPDX-License-Identifier: BSD-3-Clause
// What becomes of the events of standing edges, of texture and of moving things, where the simulator knows.
#include <CLI/CLI.hpp>
#include <array>
#include <cstdio>
#include <memory>

#include "bench.h"
#include "bench_streams.h"
#include "commands.h"
#include "evpose/io/files/config_yaml.h"
#include "evpose/io/hdf5/hdf5_file.h"

namespace evpose {
namespace {

constexpr std::size_t kOrigins = 4, kVerdicts = 6;
constexpr std::array<const char*, kOrigins> kOriginNames{
    {"texture", "standing edges", "moving things", "noise of the sensor"}};

using Tally = std::array<std::array<std::int64_t, kVerdicts>, kOrigins>;

/// Of every event of the recording: row of kOriginNames.
Expected<std::vector<std::uint8_t>> read_origins(const std::string& path) {
  auto file = Hdf5File::open(path);
  if (!file) return file.error();
  std::vector<std::uint8_t> columns[2];
  for (int k = 0; k < 2; ++k) {
    auto column = file->dataset(k == 0 ? "/truth/origin" : "/truth/cause", 1);
    if (!column) return column.error();
    columns[k].resize(column->rows());
    if (auto ok = column->read(NumberType::u8, 0, column->rows(), columns[k].data()); !ok) return ok.error();
  }
  for (std::size_t i = 0; i < columns[0].size() && i < columns[1].size(); ++i) {
    if (columns[1][i] != 0) columns[0][i] = 3;
    if (columns[0][i] >= kOrigins)
      return Error{path, text("row ", i, " of /truth/origin is no origin"), "make the recording again"};
  }
  return std::move(columns[0]);
}

/// Events since `begin_s` of the run, by origin and verdict.
Tally tally(const Streams& streams, const std::vector<std::uint8_t>& origins, double begin_s) {
  Tally out{};
  auto tracker = Tracker::create(streams.job.setup, streams.job.config.tracker, streams.job.start);
  if (!tracker) return out;
  std::size_t packet = 0, at = 0, row = 0;
  const auto next = [&] {
    ++row;
    if (++at < streams.packets[packet].events.size()) return;
    at = 0;
    do ++packet;
    while (packet < streams.packets.size() && streams.packets[packet].empty());
  };
  while (packet < streams.packets.size() && streams.packets[packet].empty()) ++packet;
  (*tracker)->on_verdicts([&](std::span<const FrontEvent> events, std::span<const EventVerdict> verdicts) {
    for (std::size_t k = 0; k < events.size(); ++k) {
      for (; packet < streams.packets.size(); next()) {
        const EventPacket& p = streams.packets[packet];
        const Event& e = p.events[at];
        if (e.x == events[k].x && e.y == events[k].y && e.on == events[k].on &&
            (*tracker)->events().stamp(p.time(e)) == events[k].stamp_us)
          break;
      }
      if (packet == streams.packets.size()) return;
      const double since_s = to_seconds(streams.packets[packet].base - streams.job.start.t);
      if (since_s >= begin_s) ++out[origins[row]][static_cast<std::size_t>(verdicts[k])];
      next();
    }
  });
  feed(streams.packets, streams.imu, **tracker);
  return out;
}

void print(const std::string& name, const Tally& tally) {
  const auto of = [&](std::size_t origin, EventVerdict v) {
    return static_cast<double>(tally[origin][static_cast<std::size_t>(v)]);
  };
  std::array<double, kOrigins> gate{}, used{};
  double all_gate = 0, all_used = 0;
  for (std::size_t o = 0; o < kOrigins; ++o) {
    used[o] = of(o, EventVerdict::contour) + of(o, EventVerdict::predicted);
    gate[o] = used[o] + of(o, EventVerdict::other_motion) + of(o, EventVerdict::wrong_polarity);
    all_gate += gate[o];
    all_used += used[o];
  }
  std::printf(
      "### %s\n\n| events | in the gate | left out: polarity | left out: motion | used | share of the used "
      "|\n",
      name.c_str());
  std::printf("|---|---|---|---|---|---|\n");
  for (std::size_t o = 0; o < kOrigins; ++o)
    std::printf("| %s | %.0f | %.1f %% | %.1f %% | %.0f | %.1f %% |\n", kOriginNames[o], gate[o],
                100 * of(o, EventVerdict::wrong_polarity) / std::max(1.0, gate[o]),
                100 * of(o, EventVerdict::other_motion) / std::max(1.0, gate[o]), used[o],
                100 * used[o] / std::max(1.0, all_used));
  const double right = of(1, EventVerdict::predicted), wrong = of(1, EventVerdict::wrong_polarity);
  std::printf(
      "\nPolarity of standing edges outside the buffer zone: %.1f %% right; of all events in the gate "
      "%.1f %% lie in the buffer zone.\n\n",
      100 * right / std::max(1.0, right + wrong),
      100 *
          (of(0, EventVerdict::contour) + of(1, EventVerdict::contour) + of(2, EventVerdict::contour) +
           of(3, EventVerdict::contour)) /
          std::max(1.0, all_gate));
  std::fflush(stdout);
}

struct EventsRequest {
  std::vector<std::string> recordings, assignments;
  double from_s = 0.3;
};

int bench_events(const EventsRequest& request) {
  RunConfig config;
  ConfigTable table;
  describe(table, config);
  for (const auto& assignment : request.assignments)
    if (auto ok = apply_assignment(table, assignment); !ok) return bad_input(ok.error());
  std::printf("Made by `evpose bench events`; do not edit.\n\n");
  for (const std::string& folder : request.recordings) {
    TrackRequest track;
    track.recording = folder;
    track.map = folder + "/contours.ply";
    track.occluders = folder + "/mesh.ply";
    auto streams = load_streams(track, config);
    if (!streams) return bad_input(streams.error());
    const std::string truth = folder + "/events_truth.h5";
    const auto origins = read_origins(truth);
    if (!origins) return bad_input(origins.error());
    std::size_t events = 0;
    for (const EventPacket& p : streams->packets) events += p.events.size();
    if (events != origins->size())
      return bad_input(
          Error{truth, text(origins->size(), " rows for ", events, " events"), "make the recording again"});
    const std::size_t slash = folder.find_last_of('/', folder.size() - 2);
    print(slash == std::string::npos ? folder : folder.substr(slash + 1),
          tally(*streams, *origins, request.from_s));
  }
  return 0;
}

}  // namespace

void add_bench_events(CLI::App& bench, std::function<int()>& run) {
  auto* command = bench.add_subcommand("events", "Simulated recordings with the truth of each event");
  auto request = std::make_shared<EventsRequest>();
  command->add_option("recordings", request->recordings, "folders made by `evpose simulate`")->required();
  command->add_option("--from", request->from_s, "seconds of the run that are left out")
      ->capture_default_str();
  command->add_option("--set", request->assignments, "one setting, key=value")->allow_extra_args(false);
  command->callback([=, &run] { run = [=] { return bench_events(*request); }; });
}

}  // namespace evpose
