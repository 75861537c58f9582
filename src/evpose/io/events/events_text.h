// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>

#include "evpose/io/events/event_reader.h"

namespace evpose {

/// Text, an event a line: `t x y p`, or `x,y,p,t`, blanks or commas, `#` comments, `%geometry:W,H`. Columns
/// and unit are found from the first lines and told with log_detail: the last column holds polarities when it
/// has only 0 and +-1, else time; a dot or exponent in the stamps means seconds. Seconds are read as decimal
/// text, to the microsecond below.
Expected<std::unique_ptr<EventReader>> open_events_text(const std::string& path,
                                                        const EventReadOptions& options);

}  // namespace evpose
