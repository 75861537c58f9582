// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "convert_parts.h"
#include "evpose/io/calibration/calibration.h"
#include "evpose/io/files/numbers.h"
#include "evpose/io/formats/create_event_writer.h"
#include "evpose/io/formats/open_events.h"
#include "evpose/run/progress.h"
#include "interrupt.h"

namespace evpose {

UndistortTable::UndistortTable(const Camera& camera, const CameraIntrinsics& c) : size_(c.size) {
  to_.resize(static_cast<std::size_t>(c.size.width) * static_cast<std::size_t>(c.size.height), {-1, -1});
  for (int y = 0; y < c.size.height; ++y) {
    for (int x = 0; x < c.size.width; ++x) {
      const auto ray = camera.unproject({static_cast<double>(x), static_cast<double>(y)});
      if (!ray || !(ray->z() > 1e-3)) continue;
      const double u = std::round(c.fx * ray->x() / ray->z() + c.cx);
      const double v = std::round(c.fy * ray->y() / ray->z() + c.cy);
      if (u < 0 || v < 0 || u >= c.size.width || v >= c.size.height) continue;
      to_[static_cast<std::size_t>(y) * static_cast<std::size_t>(c.size.width) +
          static_cast<std::size_t>(x)] = {static_cast<std::int32_t>(u), static_cast<std::int32_t>(v)};
    }
  }
}

bool UndistortTable::move(Event& event) const {
  if (event.x >= size_.width || event.y >= size_.height) return false;
  const auto& [x, y] =
      to_[static_cast<std::size_t>(event.y) * static_cast<std::size_t>(size_.width) + event.x];
  if (x < 0) return false;
  event = make_event(event.dt_us, x, y, event.on != 0);
  return true;
}

Expected<EventFilter> EventFilter::make(const ConvertRequest& request, ImageSize size) {
  EventFilter out;
  if (!request.region.empty()) {
    std::copy_n(request.region.begin(), 4, out.region_.begin());
    const auto& [x0, y0, x1, y1] = out.region_;
    if (x0 < 0 || y0 < 0 || x1 <= x0 || y1 <= y0 ||
        (size.width > 0 && (x0 >= size.width || y0 >= size.height)))
      return Error{"--region", text(x0, ",", y0, ",", x1, ",", y1, " is no part of the image"),
                   "give x0,y0,x1,y1 with x0 < x1 and y0 < y1, the last two excluded"};
  }
  if (!request.polarity.empty()) out.polarity_ = request.polarity == "on" ? 1 : 0;
  if (!request.undistort) return out;
  const auto file = read_calibration(request.calibration);
  if (!file) return file.error();
  const auto chosen = choose_camera(*file);
  if (!chosen) return chosen.error();
  if (size != ImageSize{} && chosen->intrinsics->size != size)
    return Error{
        request.calibration,
        text("is of a camera with ", chosen->intrinsics->size.width, " x ", chosen->intrinsics->size.height,
             " pixels, the events have ", size.width, " x ", size.height),
        "give the calibration of this camera"};
  out.table_.emplace(**make_camera(*chosen->intrinsics), *chosen->intrinsics);
  return out;
}

void EventFilter::apply(EventPacket& packet, ConvertCounts& counts) const {
  counts.read += static_cast<std::int64_t>(packet.events.size());
  const auto& [x0, y0, x1, y1] = region_;
  std::size_t kept = 0;
  for (Event e : packet.events) {
    const bool inside = e.x >= x0 && e.x < x1 && e.y >= y0 && e.y < y1;
    if (!inside || (polarity_ >= 0 && e.on != static_cast<unsigned>(polarity_))) {
      ++counts.cropped;
      continue;
    }
    if (table_ && !table_->move(e)) {
      ++counts.undistorted_away;
      continue;
    }
    packet.events[kept++] = e;
  }
  packet.events.resize(kept);
  counts.written += static_cast<std::int64_t>(kept);
}

Crop crop_of(const ConvertRequest& request, TimeNs first) {
  Crop out;
  if (request.start_s) out.begin = first + from_seconds(*request.start_s);
  if (request.end_s) out.end = first + from_seconds(*request.end_s);
  if (request.duration_s) {
    const TimeNs end = out.begin.value_or(first) + from_seconds(*request.duration_s);
    out.end = out.end ? std::min(*out.end, end) : end;
  }
  return out;
}

Expected<std::optional<ConvertCounts>> write_events(const ConvertRequest& request, EventReader& reader,
                                                    const EventFilter& filter, EventWriter& writer) {
  ConvertCounts counts;
  EventPacket packet;
  const EventExtent extent = reader.extent();
  Progress progress("converting");
  while (true) {
    if (InterruptGuard::interrupted()) return std::optional<ConvertCounts>();
    const auto more = reader.next(packet);
    if (!more) return more.error();
    if (!*more) break;
    progress.at(to_seconds(packet.base - extent.first_ns) /
                std::max(1e-9, to_seconds(extent.last_ns - extent.first_ns)));
    filter.apply(packet, counts);
    if (packet.empty()) continue;
    if (auto status = writer.append(packet); !status) return status.error();
  }
  if (counts.written == 0)
    return Error{request.input, "no events are left to be written",
                 "widen the crop, the region or the polarity"};
  if (auto status = writer.finish(); !status) return status.error();
  return std::optional(counts);
}

namespace {

/// Streams of the input that the output has no place for.
std::string left_out(const std::string& input) {
  const auto streams = list_streams(input);
  if (!streams) return "";
  constexpr const char* kKinds[] = {"events", "IMU", "triggers", "frames", "poses", "other messages"};
  std::string out;
  for (const StreamInfo& s : *streams) {
    if (s.kind == StreamKind::events) continue;
    out += (out.empty() ? "" : ", ") + std::string(kKinds[static_cast<std::size_t>(s.kind)]) +
           (s.name.empty() ? "" : " " + s.name);
  }
  return out;
}

/// The size of the image where the file does not say it: the calibration's, else what its pixels span.
Expected<ImageSize> find_size(const ConvertRequest& request, const EventReadOptions& options) {
  if (!request.calibration.empty()) {
    const auto file = read_calibration(request.calibration);
    if (!file) return file.error();
    const auto camera = choose_camera(*file);
    if (!camera) return camera.error();
    return camera->intrinsics->size;
  }
  const auto reader = open_events(request.input, request.input_format, options);
  if (!reader) return reader.error();
  ImageSize size;
  EventPacket packet;
  while (!InterruptGuard::interrupted()) {
    const auto more = (*reader)->next(packet);
    if (!more) return more.error();
    if (!*more) break;
    for (const Event& e : packet.events) {
      size.width = std::max(size.width, e.x + 1);
      size.height = std::max(size.height, e.y + 1);
    }
  }
  if (size == ImageSize{}) return ImageSize{1, 1};
  std::printf(
      "the input does not say the image's size: taken as %d x %d, its largest pixel; --size sets it\n",
      size.width, size.height);
  return size;
}

}  // namespace

Expected<int> convert_events(const ConvertRequest& request) {
  EventReadOptions options;
  options.topic = request.topic;
  options.packet_s = 0.01;
  options.offset_ns = from_seconds(request.offset_s);
  if (!request.size.empty()) options.size = {request.size[0], request.size[1]};
  const bool crops = request.start_s || request.end_s || request.duration_s;
  if (crops) {
    const auto probe = open_events(request.input, request.input_format, options);
    if (!probe) return probe.error();
    const Crop crop = crop_of(request, (*probe)->extent().first_ns);
    options.t_start_ns = crop.begin, options.t_end_ns = crop.end;
  }
  const auto reader = open_events(request.input, request.input_format, options);
  if (!reader) return reader.error();
  ImageSize size = (*reader)->size();
  auto filter = EventFilter::make(request, size);
  if (!filter) return filter.error();
  if (size == ImageSize{}) {
    const auto found = find_size(request, options);
    if (!found) return found.error();
    size = *found;
  }
  auto writer = create_event_writer(request.output, request.output_format, size);
  if (!writer) return writer.error();
  const auto written = write_events(request, **reader, *filter, **writer);
  if (!written) return written.error();
  if (!*written) return kInterruptedStatus;
  const ConvertCounts& counts = **written;
  std::printf("%s: %lld events", request.output.c_str(), static_cast<long long>(counts.written));
  if (counts.cropped > 0) std::printf(", %lld cropped", static_cast<long long>(counts.cropped));
  if (request.undistort)
    std::printf(", moved to the nearest whole pixel (up to 0.5 px off), %lld fell out of the image",
                static_cast<long long>(counts.undistorted_away));
  std::printf("\n");
  if (const std::string others = left_out(request.input); !others.empty())
    std::printf("left out, the format has no place for them: %s\n", others.c_str());
  return 0;
}

}  // namespace evpose
