// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "evpose/io/events/event_reader.h"
#include "evpose/io/events/sensor_streams.h"

namespace evpose {

/// Event Stream 2 (.es) of DVS and ATIS cameras; exposure readings of the latter are left out. Rows count
/// from the top, as everywhere here: the file counts from the bottom. Errors: a stream of another kind.
Expected<std::unique_ptr<EventReader>> open_events_es(const std::string& path,
                                                      const EventReadOptions& options);

/// Also of generic and colour streams, with the number of their packets or events.
Expected<std::vector<StreamInfo>> list_es_streams(const std::string& path);

bool starts_as_es(std::string_view head);

}  // namespace evpose
