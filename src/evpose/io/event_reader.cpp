// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/event_reader.h"

#include "evpose/io/event_formats.h"

namespace evpose {

Expected<std::unique_ptr<EventReader>> open_events(const std::string& path, const std::string& format,
                                                   const EventReadOptions& options) {
  const auto found = find_event_format(path, format);
  if (!found) return found.error();
  return (*found)->open(path, options);
}

}  // namespace evpose
