// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/bench/experiments/event_origins.h"

#include <array>
#include <cstdio>

#include "evpose/io/hdf5/hdf5_file.h"

namespace evpose::experiments {
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

/// The events of the packets, one after the other.
class EventCursor {
 public:
  explicit EventCursor(const std::vector<EventPacket>& packets) : packets_(packets) { skip_empty(); }

  bool ended() const { return packet_ == packets_.size(); }
  const EventPacket& packet() const { return packets_[packet_]; }
  const Event& event() const { return packet().events[at_]; }
  std::size_t row() const { return row_; }  ///< in the recording
  void next() {
    ++row_;
    if (++at_ < packet().events.size()) return;
    at_ = 0;
    ++packet_;
    skip_empty();
  }

 private:
  void skip_empty() {
    while (packet_ < packets_.size() && packets_[packet_].empty()) ++packet_;
  }

  const std::vector<EventPacket>& packets_;
  std::size_t packet_ = 0, at_ = 0, row_ = 0;
};

/// Events since `begin_s` of the run, by origin and verdict. Those with a verdict are found again among those
/// of the recording, which come in the same order.
Tally tally(const Streams& streams, const std::vector<std::uint8_t>& origins, double begin_s) {
  Tally out{};
  auto tracker = Tracker::create(streams.job.setup, streams.job.config.tracker, streams.job.start);
  if (!tracker) return out;
  EventCursor cursor(streams.packets);
  const auto at_cursor = [&](const FilteredEvent& event) {
    const Event& e = cursor.event();
    return e.x == event.x && e.y == event.y && e.on == event.on &&
           (*tracker)->events().stamp(cursor.packet().time(e)) == event.stamp_us;
  };
  (*tracker)->on_verdicts([&](std::span<const FilteredEvent> events, std::span<const EventVerdict> verdicts) {
    for (std::size_t k = 0; k < events.size(); ++k) {
      while (!cursor.ended() && !at_cursor(events[k])) cursor.next();
      if (cursor.ended()) return;
      const double since_s = to_seconds(cursor.packet().base - streams.job.start.t);
      if (since_s >= begin_s) ++out[origins[cursor.row()]][static_cast<std::size_t>(verdicts[k])];
      cursor.next();
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

/// Rows of the truth must be those of the events.
Expected<std::vector<std::uint8_t>> origins_of(const Streams& streams, const std::string& folder) {
  const std::string path = folder + "/events_truth.h5";
  auto origins = read_origins(path);
  if (!origins) return origins;
  std::size_t events = 0;
  for (const EventPacket& p : streams.packets) events += p.events.size();
  if (events != origins->size())
    return Error{path, text(origins->size(), " rows for ", events, " events"), "make the recording again"};
  return origins;
}

}  // namespace

Status print_event_origins(const EventOriginsRequest& request) {
  const auto config = configure(request.assignments);
  if (!config) return config.error();
  for (const std::string& folder : request.recordings) {
    const std::string name = folder.substr(folder.find_last_of('/', folder.size() - 2) + 1);
    const auto streams =
        load_streams(BenchRecording{name, folder, folder + "/contours.ply", folder + "/mesh.ply"}, *config);
    if (!streams) return streams.error();
    const auto origins = origins_of(*streams, folder);
    if (!origins) return origins.error();
    print(name, tally(*streams, *origins, request.from_s));
  }
  return {};
}

}  // namespace evpose::experiments
