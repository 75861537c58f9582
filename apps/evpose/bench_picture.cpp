// SPDX-License-Identifier: BSD-3-Clause
// One update drawn: its events, what the alignment made of each, and the contours that they were held
// against.
#include <CLI/CLI.hpp>
#include <array>
#include <cstdio>
#include <memory>
#include <optional>
#include <sstream>

#include "bench.h"
#include "bench_streams.h"
#include "commands.h"
#include "evpose/io/files/atomic_file.h"

namespace evpose {
namespace {

struct Kind {
  EventVerdict verdict;
  const char* colour;
  const char* name;
};
constexpr std::array<Kind, 6> kKinds{{{EventVerdict::elsewhere, "#c9ccd1", "near no contour"},
                                      {EventVerdict::beside, "#8f96a3", "outside the gate"},
                                      {EventVerdict::wrong_polarity, "#e0417f", "left out: polarity"},
                                      {EventVerdict::other_motion, "#8d4bd6", "left out: motion"},
                                      {EventVerdict::contour, "#e08a1e", "used, in the buffer zone"},
                                      {EventVerdict::predicted, "#1f77d0", "used, polarity as predicted"}}};

struct PictureRequest {
  TrackRequest track;
  std::string output;
  double at_s = 1;
  std::vector<double> crop;  ///< x, y, width, height in px
};

struct Drawn {
  std::vector<FrontEvent> events;
  std::vector<EventVerdict> verdicts;
  std::vector<Tracker::Snapshot::Point> points;
};

/// The first update at or after `at_s` of the run.
std::optional<Drawn> update_at(const Streams& streams, double at_s) {
  auto tracker = Tracker::create(streams.job.setup, streams.job.config.tracker, streams.job.start);
  if (!tracker) return std::nullopt;
  Drawn newest;
  std::optional<Drawn> out;
  (*tracker)->on_verdicts([&](std::span<const FrontEvent> events, std::span<const EventVerdict> verdicts) {
    newest.events.assign(events.begin(), events.end());
    newest.verdicts.assign(verdicts.begin(), verdicts.end());
  });
  (*tracker)->on_update([&](const Update& u) {
    if (out || to_seconds(u.t - streams.job.start.t) < at_s) return;
    out = newest;
    out->points = (*tracker)->chosen_points(0.02);
  });
  feed(streams.packets, streams.imu, **tracker);
  return out;
}

std::string svg(const Drawn& drawn, const std::vector<double>& crop) {
  constexpr double kScale = 6, kLegend = 26;
  const double x0 = crop[0], y0 = crop[1], w = crop[2], h = crop[3];
  std::ostringstream s;
  s.precision(4);
  s << "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 " << kScale * w << ' ' << kScale * h + kLegend
    << "' font-family='sans-serif' font-size='13'>\n<rect width='100%' height='100%' fill='white'/>\n";
  const auto inside = [&](double x, double y) { return x >= x0 && y >= y0 && x < x0 + w && y < y0 + h; };
  s << "<g fill='none' stroke='#1d6b3a' stroke-width='1.2'>\n";
  for (const auto& p : drawn.points)
    if (inside(p.x + 0.5, p.y + 0.5))
      s << "<circle cx='" << kScale * (p.x + 0.5 - x0) << "' cy='" << kScale * (p.y + 0.5 - y0)
        << "' r='3.5'/>";
  s << "\n</g>\n";
  for (const Kind& kind : kKinds) {
    s << "<g fill='" << kind.colour << "'>\n";
    for (std::size_t k = 0; k < drawn.events.size(); ++k)
      if (drawn.verdicts[k] == kind.verdict && inside(drawn.events[k].x, drawn.events[k].y))
        s << "<rect x='" << kScale * (drawn.events[k].x - x0) + 1 << "' y='"
          << kScale * (drawn.events[k].y - y0) + 1 << "' width='" << kScale - 2 << "' height='" << kScale - 2
          << "'/>";
    s << "\n</g>\n";
  }
  double x = 8;
  const double y = kScale * h + 17;
  for (const Kind& kind : kKinds) {
    s << "<rect x='" << x << "' y='" << y - 10 << "' width='10' height='10' fill='" << kind.colour
      << "'/><text x='" << x + 14 << "' y='" << y << "'>" << kind.name << "</text>\n";
    x += 30 + 6.6 * static_cast<double>(std::string_view(kind.name).size());
  }
  s << "<circle cx='" << x + 4 << "' cy='" << y - 5 << "' r='3.5' fill='none' stroke='#1d6b3a'/><text x='"
    << x + 14 << "' y='" << y << "'>map point</text>\n</svg>\n";
  return s.str();
}

int bench_picture(PictureRequest request) {
  auto streams = load_streams(request.track, RunConfig{});
  if (!streams) return bad_input(streams.error());
  const ImageSize size = streams->job.setup.camera->size();
  if (request.crop.empty())
    request.crop = {0, 0, static_cast<double>(size.width), static_cast<double>(size.height)};
  const auto drawn = update_at(*streams, request.at_s);
  if (!drawn)
    return bad_input(
        Error{"--at", text("no update at ", request.at_s, " s or after"), "give an earlier time"});
  if (auto ok = write_text_file(request.output, svg(*drawn, request.crop)); !ok) return bad_input(ok.error());
  return 0;
}

}  // namespace

void add_bench_picture(CLI::App& bench, std::function<int()>& run) {
  auto* command = bench.add_subcommand(
      "picture", "Draw one update: its events over the contours, by what became of them");
  auto request = std::make_shared<PictureRequest>();
  command->add_option("recording", request->track.recording, "a recording")->required();
  command->add_option("--map", request->track.map, "contour map")->required();
  command->add_option("--occluders", request->track.occluders, "mesh that hides contours");
  command->add_option("--at", request->at_s, "seconds of the run")->capture_default_str();
  command->add_option("--crop", request->crop, "x y width height, px")->expected(4);
  command->add_option("-o,--output", request->output, "SVG file")->required();
  command->callback([=, &run] { run = [=] { return bench_picture(*request); }; });
}

}  // namespace evpose
