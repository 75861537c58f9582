// SPDX-License-Identifier: BSD-3-Clause
#include "fuzz.h"

#include "evpose/io/formats/event_formats.h"
#include "evpose/io/formats/open_events.h"

namespace evpose::fuzz {
namespace {

void check_error(const Error& error) {
  EVPOSE_CHECK(!error.where.empty() && !error.what.empty());
  EVPOSE_CHECK(error.line().find('\n') == std::string::npos);
}

const EventFormat& format_named(const std::string& name) {
  for (const EventFormat& format : event_formats())
    if (format.name == name) return format;
  check_failed("the format exists", name.c_str(), 0);
}

}  // namespace

std::vector<Target>& targets() {
  static std::vector<Target> all;
  return all;
}

const Target* find_target(const std::string& name) {
  for (const Target& target : targets())
    if (target.name == name) return &target;
  return nullptr;
}

void read_all_events(const std::string& path, const std::string& format) {
  const auto reader = open_events(path, format, {});
  if (!reader) return check_error(reader.error());
  const ImageSize size = (*reader)->size();
  EventPacket packet;
  TimeNs last = INT64_MIN;
  for (int packets = 0; packets < 10'000; ++packets) {  // a file of a few bytes may claim a long time
    const auto more = (*reader)->next(packet);
    if (!more) return check_error(more.error());
    EVPOSE_CHECK(*more == !packet.empty());
    if (!*more) return;
    EVPOSE_CHECK(packet.events.front().dt_us == 0 && packet.base > last);
    for (std::size_t i = 0; i < packet.events.size(); ++i) {
      const Event& e = packet.events[i];
      EVPOSE_CHECK(size == ImageSize{} || (e.x < size.width && e.y < size.height));
      EVPOSE_CHECK(i == 0 || e.dt_us >= packet.events[i - 1].dt_us);
    }
    last = packet.time(packet.events.back());
    EVPOSE_CHECK(last / kNsPerMs == packet.base / kNsPerMs || packet.base < 0);
  }
}

void read_all_sensors(const std::string& path, const std::string& format) {
  const EventFormat& found = format_named(format);
  if (const auto streams = found.list(path); !streams) check_error(streams.error());
  if (found.read_sensors == nullptr) return;
  SensorSink sink;
  sink.imu = [](const ImuSample&) {};
  sink.trigger = [](const Trigger&) {};
  sink.pose = [](const TimedPose&) {};
  sink.frame = [](const GreyFrame& frame) {
    EVPOSE_CHECK(frame.pixels.size() == static_cast<std::size_t>(frame.width) *
                                            static_cast<std::size_t>(frame.height) *
                                            static_cast<std::size_t>(frame.channels));
  };
  if (const auto status = found.read_sensors(path, "", sink); !status) check_error(status.error());
}

void read_all(Bytes bytes, const std::string& format) {
  const std::string path = as_file(bytes);
  read_all_events(path, format);
  read_all_sensors(path, format);
}

}  // namespace evpose::fuzz
