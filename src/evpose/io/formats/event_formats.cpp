// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/formats/event_formats.h"

#include <algorithm>
#include <filesystem>

#include "evpose/io/bags/bag_reader.h"
#include "evpose/io/bags/bag_streams.h"
#include "evpose/io/events/events_aedat2.h"
#include "evpose/io/events/events_aedat3.h"
#include "evpose/io/events/events_aedat4.h"
#include "evpose/io/events/events_bin40.h"
#include "evpose/io/events/events_dat.h"
#include "evpose/io/events/events_es.h"
#include "evpose/io/events/events_h5.h"
#include "evpose/io/events/events_raw.h"
#include "evpose/io/events/events_text.h"
#include "evpose/io/files/input_file.h"
#include "evpose/io/files/numbers.h"
#include "evpose/io/motion/dataflash.h"

namespace evpose {
namespace {

constexpr std::size_t kHeadBytes = 64 << 10;

bool starts_as_hdf5(std::string_view head) { return head.starts_with("\x89HDF\r\n\x1A\n"); }

Expected<std::vector<StreamInfo>> list_text_streams(const std::string& path) {
  const auto reader = open_events_text(path, {});
  if (!reader) return reader.error();
  return std::vector<StreamInfo>{{StreamKind::events, "events", "text", -1}};
}

/// Of files that have but one stream of a kind.
template <Status (*kRead)(const std::string&, const SensorSink&)>
Status only(const std::string& path, const std::string&, const SensorSink& sink) {
  return kRead(path, sink);
}

Expected<std::unique_ptr<EventReader>> no_events_in_dataflash(const std::string& path,
                                                              const EventReadOptions&) {
  return Error{path, "is an autopilot's log, which holds no events", "name a file of events"};
}

constexpr EventFormat kFormats[] = {
    {"h5", ".h5 .hdf5", starts_as_hdf5, open_events_h5, list_h5_streams, only<read_h5_sensors>},
    {"metavision_h5", "", nullptr, open_events_h5, list_h5_streams, only<read_h5_sensors>},
    {"raw", ".raw", starts_as_raw, open_events_raw, list_raw_streams, only<read_raw_sensors>},
    {"dat", ".dat", starts_as_dat, open_events_dat, list_dat_streams, only<read_dat_sensors>},
    {"aedat4", ".aedat4", starts_as_aedat4, open_events_aedat4, list_aedat4_streams, read_aedat4_sensors},
    {"aedat3", "", starts_as_aedat3, open_events_aedat3, list_aedat3_streams, only<read_aedat3_sensors>},
    {"aedat2", ".aedat", starts_as_aedat2, open_events_aedat2, list_aedat2_streams,
     only<read_aedat2_sensors>},
    {"es", ".es", starts_as_es, open_events_es, list_es_streams, nullptr},
    {"bin40", ".bin", nullptr, open_events_bin40, list_bin40_streams, nullptr},
    {"rosbag1", ".bag", starts_as_rosbag1, open_events_bag, list_bag_streams, read_bag_sensors},
    {"mcap", ".mcap", starts_as_mcap, open_events_bag, list_bag_streams, read_bag_sensors},
    {"rosbag2", ".db3 .zstd", starts_as_rosbag2, open_events_bag, list_bag_streams, read_bag_sensors},
    {"dataflash", "", starts_as_dataflash, no_events_in_dataflash, list_dataflash_streams,
     read_dataflash_sensors},
    {"text", ".txt .csv", nullptr, open_events_text, list_text_streams, nullptr},
};

bool has_extension(const std::string& path, std::string_view extensions) {
  const std::string extension = lower_case(std::filesystem::path(path).extension().string());
  if (extension.empty()) return false;
  for (std::size_t at = 0; at < extensions.size();) {
    const auto end = std::min(extensions.find(' ', at), extensions.size());
    if (extensions.substr(at, end - at) == extension) return true;
    at = end + 1;
  }
  return false;
}

const EventFormat& by_name(std::string_view name) {
  return *std::find_if(std::begin(kFormats), std::end(kFormats),
                       [&](const EventFormat& format) { return format.name == name; });
}

}  // namespace

std::span<const EventFormat> event_formats() { return kFormats; }

Expected<const EventFormat*> find_event_format(const std::string& path, const std::string& name) {
  if (!name.empty()) {
    std::string known;
    for (const EventFormat& format : kFormats) {
      if (format.name == name) return &format;
      known += text(known.empty() ? "" : ", ", format.name);
    }
    return Error{path, "the event format '" + name + "' is unknown", "events.format is one of " + known};
  }
  if (is_rosbag2_folder(path)) return &by_name("rosbag2");
  const auto head = first_bytes(path, kHeadBytes);
  if (!head) return head.error();
  for (const EventFormat& format : kFormats)
    if (format.recognises != nullptr && format.recognises(*head)) return &format;
  for (const EventFormat& format : kFormats)
    if (has_extension(path, format.extensions)) return &format;
  return &by_name("text");
}

}  // namespace evpose
