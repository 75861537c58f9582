// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/formats/create_event_writer.h"

#include "evpose/io/bags/bag_writer.h"
#include "evpose/io/events/events_h5.h"
#include "evpose/io/events/events_raw_writer.h"
#include "evpose/io/events/events_text_writer.h"

namespace evpose {
namespace {

std::string format_of(const std::string& path) {
  if (path.ends_with(".h5") || path.ends_with(".hdf5")) return "h5";
  if (path.ends_with(".raw")) return "raw";
  if (path.ends_with(".txt") || path.ends_with(".csv")) return "text";
  if (path.ends_with(".bag")) return "rosbag1";
  if (path.ends_with(".mcap")) return "mcap";
  return "";
}

template <class Writer>
Expected<std::unique_ptr<EventWriter>> boxed(Expected<Writer> writer) {
  if (!writer) return writer.error();
  return std::unique_ptr<EventWriter>(std::make_unique<Writer>(*std::move(writer)));
}

}  // namespace

Expected<std::unique_ptr<EventWriter>> create_event_writer(const std::string& path, const std::string& format,
                                                           ImageSize size) {
  if (size.width <= 0 || size.height <= 0)
    return Error{path, "the image size is not known", "give it with the input"};
  const std::string name = format.empty() ? format_of(path) : format;
  if (name == "h5") return boxed(EventWriterH5::create(path, size, ""));
  if (name == "raw") return boxed(EventWriterRaw::create(path, size));
  if (name == "rosbag1" || name == "mcap") return boxed(BagWriter::create(path, size, {.format = name}));
  if (name == "text") return boxed(EventWriterText::create(path, size));
  return Error{
      path,
      name.empty() ? "its extension names no event format" : "events cannot be written as '" + name + "'",
      "use .h5, .raw, .bag, .mcap, .txt or .csv"};
}

}  // namespace evpose
