// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/event_reader.h"

#include <array>

#include "evpose/io/events_h5.h"
#include "evpose/io/events_text.h"
#include "evpose/io/input_file.h"

namespace evpose {
namespace {

bool starts_as_hdf5(const InputFile& file) {
  constexpr std::array<unsigned char, 8> kSignature = {0x89, 'H', 'D', 'F', '\r', '\n', 0x1A, '\n'};
  std::array<unsigned char, 8> head{};
  return std::fread(head.data(), 1, head.size(), file.stream.get()) == head.size() && head == kSignature;
}

bool ends_as_hdf5(const std::string& path) { return path.ends_with(".h5") || path.ends_with(".hdf5"); }

}  // namespace

Expected<std::unique_ptr<EventReader>> open_events(const std::string& path, const std::string& format,
                                                   const EventReadOptions& options) {
  const auto file = open_to_read(path);
  if (!file) return file.error();
  if (format == "h5" || (format.empty() && (ends_as_hdf5(path) || starts_as_hdf5(*file))))
    return open_events_h5(path, options);
  if (format == "text" || format.empty()) return open_events_text(path, options);
  return Error{path, "the event format '" + format + "' cannot be read", "convert it to h5 or text"};
}

}  // namespace evpose
