// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>

#include "evpose/io/events/event_reader.h"
#include "evpose/io/events/sensor_streams.h"

namespace evpose {

/// Events of 40 bits, without a header (N-MNIST, N-Caltech101): column, row, then polarity and 23 bits of
/// microseconds. Row 240 is no pixel: such a record lets 8192 us pass. Told by the extension .bin alone.
/// Errors: a length that is no multiple of 5 bytes, steps back in time.
Expected<std::unique_ptr<EventReader>> open_events_bin40(const std::string& path,
                                                         const EventReadOptions& options);

Expected<std::vector<StreamInfo>> list_bin40_streams(const std::string& path);

}  // namespace evpose
