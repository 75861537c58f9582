// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <ctime>

#include "evpose/io/files/numbers.h"
#include "evpose/io/formats/event_formats.h"
#include "evpose/io/formats/open_events.h"
#include "evpose/io/recording/event_survey.h"
#include "evpose/run/progress.h"
#include "info_parts.h"

namespace evpose {
namespace {

constexpr TimeNs kUnixFrom = 1'000'000'000 * kNsPerS;  // 2001: no sensor is on for so long
constexpr std::size_t kHotShown = 5, kOthersShown = 5;

std::string seconds(TimeNs t) { return format_decimal(t / kNsPerUs, 6); }

std::string rate_text(double per_s) {
  if (per_s >= 1e6) return fixed(1e-6 * per_s, 2) + " Mev/s";
  return per_s >= 1e3 ? fixed(1e-3 * per_s, 1) + " kev/s" : fixed(per_s, 0) + " ev/s";
}

void polarity(Sheet& sheet, const std::string& where, const EventSummary& s) {
  const double share = 100 * static_cast<double>(s.on) / static_cast<double>(s.count);
  sheet.row("", "", "on", s.on);
  sheet.row("", "", "off", s.count - s.on);
  sheet.row("polarity", fixed(share, 1) + " % on, " + fixed(100 - share, 1) + " % off", "on_percent", share);
  if (s.count >= 1000 && (share < 2 || share > 98))
    sheet.find(
        {where, fixed(share, 1) + " % of the events are on", "was one polarity lost when it was converted?"});
}

void image(Sheet& sheet, const std::string& where, const EventSummary& s, ImageSize size) {
  const bool stated = size != ImageSize{};
  sheet.row("image",
            (stated ? text(size.width, " x ", size.height) : std::string("size not stated")) +
                text(", pixels up to (", s.widest_x, ", ", s.highest_y, "), ", s.active_pixels, " active"),
            "active_pixels", s.active_pixels);
  if (stated) sheet.row("", "", "resolution", {size.width, size.height});
  sheet.row("", "", "largest_pixel", {s.widest_x, s.highest_y});
  if (!stated)
    sheet.find({where, "the file does not say the image's size",
                "give it as events.resolution in recording.yaml, or with the calibration"});
}

void rate(Sheet& sheet, const std::string& where, const EventSummary& s) {
  sheet.row("rate",
            rate_text(s.mean_rate()) + " mean, " + rate_text(s.loudest_rate) + " at the loudest (10 ms at " +
                seconds(s.loudest_at) + " s)",
            "mean_rate_ev_s", s.mean_rate());
  sheet.row("", "", "largest_rate_ev_s", s.loudest_rate);
  std::vector<double> rates;
  for (const std::int64_t n : s.bins) rates.push_back(static_cast<double>(n) / to_seconds(s.bin_ns));
  sheet.row("over time", "|" + sparkline(rates) + "| " + fixed(to_seconds(s.bin_ns), 2) + " s each",
            "rate_over_time_ev_s", rates);
  sheet.row("", "", "rate_over_time_step_s", to_seconds(s.bin_ns));
  sheet.row("", "", "bursts", s.bursts);
  if (s.bursts > 0)
    sheet.find({where,
                text(s.bursts, " stretches of 10 ms with more than ten times the usual rate, the loudest at ",
                     seconds(s.loudest_at), " s"),
                "a flash or a light that is switched? See that the rate controller was off"});
}

void gaps(Sheet& sheet, const std::string& where, const EventSummary& s) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const EventGap& gap : s.gaps) list.push_back({to_seconds(gap.begin), to_seconds(gap.end)});
  const std::string longest =
      s.gaps.empty()
          ? "none"
          : text(s.gap_count, ", the longest ", fixed(1e3 * to_seconds(s.gaps[0].end - s.gaps[0].begin), 1),
                 " ms after ", seconds(s.gaps[0].begin), " s");
  sheet.row("gaps", longest, "gaps_s", list);
  sheet.row("", "", "gap_count", s.gap_count);
  if (s.gap_count > 0)
    sheet.find({where,
                text("no events for up to ", fixed(1e3 * to_seconds(s.gaps[0].end - s.gaps[0].begin), 1),
                     " ms, ", s.gap_count, " times"),
                "lost data, or nothing moved? Check the cable's bandwidth and the recorder's load"});
}

void hot_pixels(Sheet& sheet, const std::string& where, const EventSummary& s) {
  std::string worst;
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const PixelCount& p : s.hot) {
    list.push_back({{"x", p.x}, {"y", p.y}, {"events", p.count}});
    if (list.size() <= kHotShown) worst += text(worst.empty() ? ": " : ", ", "(", p.x, ", ", p.y, ")");
  }
  const double share = 100 * static_cast<double>(s.hot_events) / static_cast<double>(s.count);
  sheet.row("hot pixels", s.hot_count == 0 ? "none" : text(s.hot_count, worst), "hot_pixels", list);
  sheet.row("", "", "hot_pixel_count", s.hot_count);
  if (s.hot_count > 0)
    sheet.find({where, text(s.hot_count, " hot pixels make ", fixed(share, 1), " % of the events"),
                "the tracker masks them; calibrate the sensor's thresholds if there are many"});
}

/// Reads to the end; what stops it early is a finding, or the error if it stops at once.
Expected<EventSummary> read_through(Sheet& sheet, EventReader& reader) {
  EventSurvey survey;
  EventPacket packet;
  const EventExtent extent = reader.extent();
  Progress progress("reading");
  std::size_t events_read = 0;
  while (true) {
    const auto more = reader.next(packet);
    if (!more && events_read == 0) return more.error();
    if (!more) sheet.find(more.error());
    if (!more || !*more) break;
    events_read += packet.events.size();
    survey.add(packet);
    progress.at(to_seconds(packet.base - extent.first_ns) /
                std::max(1e-9, to_seconds(extent.last_ns - extent.first_ns)));
  }
  return survey.finish();
}

}  // namespace

std::string span_text(const Span& span) {
  std::string out = seconds(span.first) + " .. " + seconds(span.last) + " s (" +
                    fixed(to_seconds(span.last - span.first), 3) + " s)";
  if (span.first < kUnixFrom) return out;
  const std::time_t t = span.first / kNsPerS;
  std::tm utc{};
  gmtime_r(&t, &utc);
  char date[40];
  std::strftime(date, sizeof date, "%Y-%m-%d %H:%M:%S", &utc);
  return out + ", from " + date + " UTC";
}

Expected<Span> describe_events(Sheet& sheet, const std::string& path, const std::string& format,
                               const EventReadOptions& options) {
  EventReadOptions how = options;
  how.packet_s = 0.01;
  const auto reader = open_events(path, format, how);
  if (!reader) return reader.error();
  const auto kind = find_event_format(path, format);
  sheet.section("events: " + path, "events");
  if (kind) sheet.row("format", (*kind)->name, "format", (*kind)->name);
  const auto summary = read_through(sheet, **reader);
  if (!summary) return summary.error();
  const EventSummary& s = *summary;
  sheet.row("count", text(s.count), "count", s.count);
  if (s.count == 0) return Error{path, "holds no events that can be read", "record again"};
  const Span span{s.first, s.last};
  sheet.row("time", span_text(span), "first_s", to_seconds(s.first));
  sheet.row("", "", "first_ns", s.first);
  sheet.row("", "", "last_ns", s.last);
  sheet.row("", "", "duration_s", s.duration_s());
  polarity(sheet, path, s);
  image(sheet, path, s, (*reader)->size());
  rate(sheet, path, s);
  gaps(sheet, path, s);
  hot_pixels(sheet, path, s);
  return span;
}

Expected<std::optional<Span>> describe_sensors(Sheet& sheet, const std::string& path) {
  const auto streams = list_streams(path);
  if (!streams) return streams.error();
  const bool more_than_events = std::any_of(streams->begin(), streams->end(),
                                            [](const StreamInfo& s) { return s.kind != StreamKind::events; });
  if (!more_than_events) return std::optional<Span>();
  sheet.section("streams: " + path, "streams");
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  constexpr const char* kKinds[] = {"events", "imu", "triggers", "frames", "poses", "other"};
  std::size_t others = 0;
  for (const StreamInfo& s : *streams) {
    const char* kind = kKinds[static_cast<std::size_t>(s.kind)];
    list.push_back({{"kind", kind}, {"name", s.name}, {"type", s.type}, {"messages", s.messages}});
    if (s.kind == StreamKind::other && ++others > kOthersShown) continue;
    sheet.note(kind, (s.name.empty() ? std::string("-") : s.name) + "  " + s.type +
                         (s.messages >= 0 ? text("  ", s.messages, " messages") : std::string()));
  }
  if (others > kOthersShown) sheet.note("other", text("and ", others - kOthersShown, " more"));
  sheet.row("", "", "list", list);

  std::vector<ImuSample> imu;
  std::vector<TimedPose> poses;
  std::int64_t triggers = 0, rising = 0, frames = 0;
  SensorSink sink;
  sink.imu = [&](const ImuSample& s) { imu.push_back(s); };
  sink.pose = [&](const TimedPose& p) { poses.push_back(p); };
  sink.trigger = [&](const Trigger& t) { ++triggers, rising += t.on ? 1 : 0; };
  sink.frame = [&](const GreyFrame&) { ++frames; };
  if (auto status = read_sensors(path, "", sink); !status) sheet.find(status.error());
  if (triggers > 0) sheet.row("triggers", text(triggers, " (", rising, " on)"), "triggers", triggers);
  if (frames > 0) sheet.row("frames", text(frames), "frames", frames);
  if (!poses.empty()) describe_trajectory(sheet, path, poses, "poses");
  if (imu.empty()) return std::optional<Span>();
  return std::optional<Span>(describe_imu(sheet, path, imu));
}

void compare_spans(Sheet& sheet, const std::string& where, const Span& events, const Span& imu) {
  constexpr double kOtherEpoch_s = 1e8;
  const TimeNs first = std::max(events.first, imu.first), last = std::min(events.last, imu.last);
  const double shared = to_seconds(std::max<TimeNs>(0, last - first));
  sheet.section("events and IMU together", "together");
  sheet.row("overlap", fixed(shared, 3) + " s", "overlap_s", shared);
  if (last > first) {
    const double outside = to_seconds(events.last - events.first) - shared;
    if (outside > 0.1)
      sheet.find(
          {where, text(fixed(outside, 3), " s of events have no IMU"), "they are left out when tracking"});
    return;
  }
  const double apart = to_seconds(imu.first - events.first);
  sheet.find({where,
              std::abs(apart) > kOtherEpoch_s
                  ? text("events and IMU have different epochs, ", fixed(apart, 3), " s apart")
                  : std::string("events and IMU do not overlap in time"),
              "set time.offset_events_s in recording.yaml, or check the units of time"});
}

}  // namespace evpose
