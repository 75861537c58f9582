// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/bench/experiments/update_picture.h"

#include <array>
#include <optional>
#include <sstream>

#include "evpose/io/files/atomic_file.h"

namespace evpose::experiments {
namespace {

constexpr double kScale = 6, kLegend = 26;  // of the picture: px for a pixel, height of the legend

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

struct Drawn {
  std::vector<FilteredEvent> events;
  std::vector<EventVerdict> verdicts;
  std::vector<Snapshot::Point> points;
};

/// The first update at or after `at_s` of the run.
std::optional<Drawn> update_at(const Streams& streams, double at_s) {
  auto tracker = Tracker::create(streams.job.setup, streams.job.config.tracker, streams.job.start);
  if (!tracker) return std::nullopt;
  Drawn newest;
  std::optional<Drawn> out;
  (*tracker)->on_verdicts([&](std::span<const FilteredEvent> events, std::span<const EventVerdict> verdicts) {
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

void draw_points(const Drawn& drawn, const PictureCrop& crop, std::ostringstream& s) {
  s << "<g fill='none' stroke='#1d6b3a' stroke-width='1.2'>\n";
  for (const auto& p : drawn.points)
    if (crop.holds(p.x + 0.5, p.y + 0.5))
      s << "<circle cx='" << kScale * (p.x + 0.5 - crop.x) << "' cy='" << kScale * (p.y + 0.5 - crop.y)
        << "' r='3.5'/>";
  s << "\n</g>\n";
}

void draw_events(const Drawn& drawn, const PictureCrop& crop, std::ostringstream& s) {
  for (const Kind& kind : kKinds) {
    s << "<g fill='" << kind.colour << "'>\n";
    for (std::size_t k = 0; k < drawn.events.size(); ++k)
      if (drawn.verdicts[k] == kind.verdict && crop.holds(drawn.events[k].x, drawn.events[k].y))
        s << "<rect x='" << kScale * (drawn.events[k].x - crop.x) + 1 << "' y='"
          << kScale * (drawn.events[k].y - crop.y) + 1 << "' width='" << kScale - 2 << "' height='"
          << kScale - 2 << "'/>";
    s << "\n</g>\n";
  }
}

void draw_legend(double y, std::ostringstream& s) {
  double x = 8;
  for (const Kind& kind : kKinds) {
    s << "<rect x='" << x << "' y='" << y - 10 << "' width='10' height='10' fill='" << kind.colour
      << "'/><text x='" << x + 14 << "' y='" << y << "'>" << kind.name << "</text>\n";
    x += 30 + 6.6 * static_cast<double>(std::string_view(kind.name).size());
  }
  s << "<circle cx='" << x + 4 << "' cy='" << y - 5 << "' r='3.5' fill='none' stroke='#1d6b3a'/><text x='"
    << x + 14 << "' y='" << y << "'>map point</text>\n";
}

std::string svg(const Drawn& drawn, const PictureCrop& crop) {
  std::ostringstream s;
  s.precision(4);
  s << "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 " << kScale * crop.width << ' '
    << kScale * crop.height + kLegend
    << "' font-family='sans-serif' font-size='13'>\n<rect width='100%' height='100%' fill='white'/>\n";
  draw_points(drawn, crop, s);
  draw_events(drawn, crop, s);
  draw_legend(kScale * crop.height + 17, s);
  s << "</svg>\n";
  return s.str();
}

}  // namespace

Status draw_update(const UpdatePictureRequest& request) {
  const auto streams = load_streams(request.recording, RunConfig{});
  if (!streams) return streams.error();
  const ImageSize size = streams->job.setup.camera->size();
  const PictureCrop whole{0, 0, static_cast<double>(size.width), static_cast<double>(size.height)};
  const auto drawn = update_at(*streams, request.at_s);
  if (!drawn)
    return Error{"--at", text("no update at ", request.at_s, " s or after"), "give an earlier time"};
  return write_text_file(request.output, svg(*drawn, request.crop.value_or(whole)));
}

}  // namespace evpose::experiments
