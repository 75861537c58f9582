// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>

#include "evpose/camera/camera.h"
#include "evpose/io/events/event_writer.h"

namespace evpose {

/// `format`: "h5" (events.h5), "raw" (Prophesee RAW, EVT3) or "text" (`t x y p`, seconds; with the extension
/// .csv the vendor's `x,y,p,t`, microseconds), "rosbag1" or "mcap" (bag_writer.h has more to say); empty: by
/// the extension of `path`. Errors: unknown format, a size that the format cannot carry, the folder cannot be
/// written.
Expected<std::unique_ptr<EventWriter>> create_event_writer(const std::string& path, const std::string& format,
                                                           ImageSize size);

}  // namespace evpose
